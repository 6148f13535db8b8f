// SPDX-License-Identifier: Apache-2.0
#include "train/ops/light_frames.h"

#include <vector>

#include "base/error.h"
#include "nn/nn.h"
#include "scene/light_frame.h"

namespace tilegrad::train {
namespace {

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
      const std::array<double, 9> column = HarmonicsToWorld(unit, cameras[n]);
      for (std::size_t to = 0; to < 9; ++to) matrices[81 * n + 9 * to + from] = column[to];
    }
  }
  return Turn(sh, matrices, 9);
}

}  // namespace tilegrad::train
