// SPDX-License-Identifier: Apache-2.0
// Perceptrons: of plain layers, and of residual ones for the light of sections 5.2 and 5.3.
#pragma once

#include <vector>

#include "nn/layers.h"

namespace tilegrad::nn {

// Linear layers of these widths (input first), an activation after each but the last; as "fc1",
// "fc2", ..
struct MlpShape {
  std::vector<std::int64_t> widths;
  Activation::Function activation = nullptr;
};
void AddMlp(Sequential& net, Context& context, const MlpShape& shape, Rng& rng);

// [n, in] -> [n, out] by a linear layer, `blocks` residual blocks of two (x + fc(relu(fc(relu x))))
// and a linear layer: with the default two blocks the six layers of the paper's light regressor,
// whose output is up to the shader: a direction, nine harmonics, or a direction and a shininess.
struct LightHeadShape {
  std::int64_t in = 512, width = 128, out = 3;
  int blocks = 2;
};
void AddLightHead(Sequential& net, Context& context, const LightHeadShape& shape, Rng& rng);

}  // namespace tilegrad::nn
