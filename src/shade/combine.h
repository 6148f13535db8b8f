// SPDX-License-Identifier: Apache-2.0
// The colour of a pixel from its parts (equation 7: I = I_l I_c + I_s):
//
//   I_c = base * texture * vertex colour                 (an absent factor is 1)
//   I_l = ambient + diffuse * light                      (1 without light)
//   I_s = specular * highlight                           (0 without highlight)
#pragma once

#include <array>
#include <cstddef>

#include "shade/pixel_run.h"

namespace tilegrad::shade {

template <class T>
struct ColorFactorsT {
  std::array<T, 3> base, ambient, diffuse, specular;
};
using ColorFactors = ColorFactorsT<float>;

struct CombineInput {
  ColorFactors factors;
  const RunPlane* texture = nullptr;       // [3]; null: absent
  const RunPlane* vertex_color = nullptr;  // [3]
  const RunPlane* light = nullptr;
  const RunPlane* highlight = nullptr;
  bool clamp = false;  // to [0, 1]
};

// Null: not requested. Overwrites planes, adds to sums.
struct CombineAdjoint {
  RunPlane* d_texture = nullptr;       // [3]
  RunPlane* d_vertex_color = nullptr;  // [3]
  RunPlane* d_light = nullptr;
  RunPlane* d_highlight = nullptr;
  ColorFactorsT<double>* d_factors = nullptr;
};

void Combine(std::size_t count, const CombineInput& input, RunPlane* color);

// A clamped colour has no gradient.
void CombineAdjointOf(std::size_t count, const CombineInput& input, const RunPlane* d_color,
                      const CombineAdjoint& out);

}  // namespace tilegrad::shade
