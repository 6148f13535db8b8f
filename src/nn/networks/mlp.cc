// SPDX-License-Identifier: Apache-2.0
#include "nn/networks/mlp.h"

#include <string>

#include "nn/ops/pointwise.h"

namespace tilegrad::nn {

void AddMlp(Sequential& net, Context& context, const MlpShape& shape, Rng& rng) {
  for (std::size_t i = 1; i < shape.widths.size(); ++i) {
    const std::string number = std::to_string(i);
    net.Add<LinearLayer>("fc" + number, context,
                         LinearShape{.in = shape.widths[i - 1], .out = shape.widths[i]}, rng);
    const bool last = i + 1 == shape.widths.size();
    if (!last && shape.activation != nullptr) {
      net.Add<Activation>("act" + number, shape.activation);
    }
  }
}

void AddLightHead(Sequential& net, Context& context, const LightHeadShape& shape, Rng& rng) {
  const LinearShape inner{.in = shape.width, .out = shape.width};
  net.Add<LinearLayer>("in", context, LinearShape{.in = shape.in, .out = shape.width}, rng);
  for (int i = 1; i <= shape.blocks; ++i) {
    auto& body = net.Add<Residual>("block" + std::to_string(i)).body;
    body.Add<Activation>("act1", &Relu);
    body.Add<LinearLayer>("fc1", context, inner, rng);
    body.Add<Activation>("act2", &Relu);
    body.Add<LinearLayer>("fc2", context, inner, rng);
  }
  net.Add<Activation>("act", &Relu);
  net.Add<LinearLayer>("out", context, LinearShape{.in = shape.width, .out = shape.out}, rng);
}

}  // namespace tilegrad::nn
