// SPDX-License-Identifier: Apache-2.0
// Masks as soft as the renders that are held to them.
#pragma once

#include <vector>

#include "fit/hull/mask_distance.h"
#include "fit/image_loss.h"

namespace tilegrad::train {

// A soft silhouette (equation 5) reaches beyond its shape: held to a mask as it is, a shape comes
// out too small, by about the softness on each side, which is much of a chair's leg. So it is held
// to what the true shape's would be: 1 inside of the mask's outline, exp(-d^2 / delta) at a
// distance d outside.
class SoftTargets {
 public:
  SoftTargets(TargetImages images, const Workers& workers);

  // The images, with `silhouette` set for these views. delta in squared NDC. Allocates nothing.
  const TargetImages& At(double delta, std::span<const int> views, const Workers& workers);

 private:
  TargetImages images_;
  std::vector<MaskDistance> distances_;  // of each view
};

}  // namespace tilegrad::train
