// SPDX-License-Identifier: Apache-2.0
// One image with its mask, as a fit takes it.
#pragma once

#include <string>
#include <vector>

#include "fit/transforms.h"

namespace tilegrad::train {

struct ViewPixels {
  ImageSize size;
  std::vector<float> color, alpha;  // [3,H,W] straight, [H,W]
  std::string mask;                 // where the alpha is from, for messages; empty: it is all 1

  std::size_t pixels() const { return alpha.size(); }
};

// Turned as the frame's camera counts pixels. Errors name the file.
Result<ViewPixels> LoadViewPixels(const TransformsFrame& frame);

}  // namespace tilegrad::train
