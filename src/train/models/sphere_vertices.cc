// SPDX-License-Identifier: Apache-2.0
#include "train/models/sphere_vertices.h"

#include <cmath>
#include <vector>

#include "nn/nn.h"

namespace tilegrad::train {

nn::Var SphereVertices(const nn::Var& bias, const nn::Var& centroid, const nn::Tensor& sphere) {
  nn::Context& context = bias.context();
  nn::Tensor given = sphere;
  std::vector<double> sign, logit;
  nn::WithFloatType(sphere.dtype(), [&]<class T>(T) {
    for (const T value : given.span<T>()) {
      const double half = std::abs(static_cast<double>(value)) / 2;
      sign.push_back(half > 0 ? std::copysign(1.0, static_cast<double>(value)) : 0.0);
      logit.push_back(half > 0 ? std::log(half / (1 - half)) : 0.0);  // of no effect at 0
    }
  });
  const auto constant = [&](const std::vector<double>& values) {
    return nn::Constant(context, context.From(sphere.shape(), std::span<const double>(values)));
  };
  const nn::Var u = constant(sign) * nn::Sigmoid(bias + constant(logit));
  const nn::Var c = nn::Tanh(0.1 * centroid);
  return 0.5 * (nn::Relu(u) * (1.0 - c) - nn::Relu(-u) * (1.0 + c) + c);
}

}  // namespace tilegrad::train
