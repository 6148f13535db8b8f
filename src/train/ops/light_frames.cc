// SPDX-License-Identifier: Apache-2.0
#include "train/ops/light_frames.h"

#include <numbers>
#include <vector>

#include "base/error.h"
#include "nn/nn.h"

namespace tilegrad::train {
namespace {

// The factors of 3z^2 - 1 and x^2 - y^2 in units of that of xy: only ratios matter to a rotation.
constexpr double kZ = 0.5 / std::numbers::sqrt3, kXy = 0.5;

using Matrix = std::array<std::array<double, 3>, 3>;

// R^T A R.
Matrix Turned(const Matrix& a, const Camera& camera) {
  Matrix out = {};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 9; ++k) {
        out[i][j] += camera.rotation[3 * (k / 3) + i] * a[k / 3][k % 3] *
                     static_cast<double>(camera.rotation[3 * (k % 3) + j]);
      }
    }
  }
  return out;
}

// The linear part is b . n, the quadratic one n^T A n with a symmetric A of trace 0.
std::array<double, 9> TurnedHarmonics(const std::array<double, 9>& c, const Camera& camera) {
  const double b[3] = {-c[3], -c[1], c[2]};
  double t[3] = {};
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) t[i] += camera.rotation[3 * k + i] * b[k];
  }
  const double xy = kXy * c[4], yz = -kXy * c[5], xz = -kXy * c[7];
  const Matrix a = Turned({{{kXy * c[8] - kZ * c[6], xy, xz},
                            {xy, -kXy * c[8] - kZ * c[6], yz},
                            {xz, yz, 2 * kZ * c[6]}}},
                          camera);
  return {c[0],
          -t[1],
          t[2],
          -t[0],
          a[0][1] / kXy,
          -a[1][2] / kXy,
          a[2][2] / (2 * kZ),
          -a[0][2] / kXy,
          (a[0][0] - a[1][1]) / (2 * kXy)};
}

// y[n] = matrix n times x[n]; matrices: [N,size,size].
nn::Var Turn(const nn::Var& x, const std::vector<double>& matrices, std::int64_t size) {
  const std::int64_t images = static_cast<std::int64_t>(matrices.size()) / (size * size);
  if (!x.valid()) return x;
  if (!(x.shape() == nn::Shape{images, size})) {
    return nn::Fail(x, InternalError("lights {} of {} cameras", x.shape().ToString(), images));
  }
  nn::Context& context = x.context();
  nn::Tensor tensor = context.Empty({images, size, size}, x.dtype());
  nn::WithFloatType(x.dtype(), [&]<class T>(T) {
    for (std::size_t i = 0; i < matrices.size(); ++i)
      tensor.data<T>()[i] = static_cast<T>(matrices[i]);
  });
  return nn::Sum(nn::Constant(context, std::move(tensor)) * nn::Reshape(x, {images, 1, size}), {2});
}

}  // namespace

nn::Var DirectionsToWorld(const nn::Var& directions, std::span<const Camera> cameras) {
  std::vector<double> matrices;
  matrices.reserve(9 * cameras.size());
  for (const Camera& camera : cameras) {
    for (int i = 0; i < 9; ++i) matrices.push_back(camera.rotation[3 * (i % 3) + i / 3]);
  }
  return Turn(directions, matrices, 3);
}

nn::Var HarmonicsToWorld(const nn::Var& sh, std::span<const Camera> cameras) {
  std::vector<double> matrices(81 * cameras.size());
  for (std::size_t n = 0; n < cameras.size(); ++n) {
    for (std::size_t from = 0; from < 9; ++from) {
      std::array<double, 9> unit = {};
      unit[from] = 1;
      const std::array<double, 9> column = TurnedHarmonics(unit, cameras[n]);
      for (std::size_t to = 0; to < 9; ++to) matrices[81 * n + 9 * to + from] = column[to];
    }
  }
  return Turn(sh, matrices, 9);
}

std::array<float, 3> DirectionToWorld(const std::array<float, 3>& direction, const Camera& camera) {
  std::array<float, 3> out = {};
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k)
      out[static_cast<std::size_t>(i)] +=
          camera.rotation[3 * k + i] * direction[static_cast<std::size_t>(k)];
  }
  return out;
}

std::array<float, 9> HarmonicsToWorld(const std::array<float, 9>& sh, const Camera& camera) {
  std::array<double, 9> in;
  for (std::size_t i = 0; i < 9; ++i) in[i] = sh[i];
  const std::array<double, 9> turned = TurnedHarmonics(in, camera);
  std::array<float, 9> out;
  for (std::size_t i = 0; i < 9; ++i) out[i] = static_cast<float>(turned[i]);
  return out;
}

}  // namespace tilegrad::train
