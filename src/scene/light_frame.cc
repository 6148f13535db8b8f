// SPDX-License-Identifier: Apache-2.0
#include "scene/light_frame.h"

#include <algorithm>
#include <numbers>

namespace tilegrad {
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

}  // namespace

std::array<double, 9> HarmonicsToWorld(const std::array<double, 9>& c, const Camera& camera) {
  // The linear part is b . n, the quadratic one n^T A n with a symmetric A of trace 0.
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
  std::copy(sh.begin(), sh.end(), in.begin());
  std::array<float, 9> out;
  std::ranges::transform(HarmonicsToWorld(in, camera), out.begin(),
                         [](double x) { return static_cast<float>(x); });
  return out;
}

}  // namespace tilegrad
