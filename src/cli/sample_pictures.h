// SPDX-License-Identifier: Apache-2.0
// Pictures that `tilegrad sample` makes of generated objects.
#pragma once

#include <span>

#include "base/file.h"
#include "train/tasks/gan/model.h"

namespace tilegrad::cli {

// The first objects, side by side, turning once.
Status AnimateSamples(std::span<const Mesh> meshes, const Path& file, const Workers& workers);

struct InterpolationJob {
  std::span<const std::vector<float>> codes;  // at least 2
  int steps = 8;                              // from each code to the next, the last to the first
  Path strip, animation;
};
// How evenly an interpolation goes: the largest difference of neighbouring pictures of a row as a
// multiple of the row's mean one. Of all rows.
struct InterpolationSteps {
  double mean = 0, largest = 0;
};
// A row of pictures for each pair of codes, and an animation of them all.
Result<InterpolationSteps> DrawInterpolation(const InterpolationJob& job,
                                             train::GeneratorModel& model, const Workers& workers);

}  // namespace tilegrad::cli
