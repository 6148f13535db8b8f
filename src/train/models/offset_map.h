// SPDX-License-Identifier: Apache-2.0
// From what a decoder says to offsets of a template's vertices.
#pragma once

#include "nn/ops/axis_map.h"
#include "scene/mesh.h"

namespace tilegrad::train {

struct OffsetRules {
  std::int64_t smoothing = 0;  // rounds of diffusion over the template
  bool symmetric = false;      // offsets are the mean of themselves and their mirror image at x = 0
};

class OffsetMap {
 public:
  OffsetMap() = default;
  // `sphere`: the template, centred; with `symmetric` its mirrored coordinates have equal bits.
  OffsetMap(nn::Context& context, const Mesh& sphere, const OffsetRules& rules);
  nn::Var Apply(const nn::Var& raw) const;  // [B, 3 V] -> [B, V, 3]

 private:
  nn::Var Mapped(const nn::Var& raw) const;

  OffsetRules rules_;
  std::int64_t vertices_ = 0;
  nn::AxisMap diffusion_;  // one round
  nn::AxisMap symmetry_;   // of [3 V] offsets
};

}  // namespace tilegrad::train
