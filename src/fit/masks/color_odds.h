// SPDX-License-Identifier: Apache-2.0
// What colours say about whether a pixel shows the object: histograms inside and outside.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "fit/image_loss.h"

namespace tilegrad::train {

// The colours of N views in bins of brightness and two differences of channels.
class ColorOdds {
 public:
  // `images` without regard to their alpha.
  ColorOdds(const TargetImages& images, const Workers& workers);

  // `inside` [N,H,W] in [0, 1]: how far each pixel is believed to show the object. What a view
  // shows counts as much as what all show: walls differ from view to view, the object does not.
  void Learn(std::span<const float> inside, const Workers& workers);

  // ln of how much more probable a view's pixels are inside than outside, [H,W], at most kMostOdds
  // either way by their colours. `images` may have another size than those that it learned from.
  // `floor` [H,W] is Floor::Agreement: what agrees with it and has the colour of something outside,
  // only darker, is taken for its shadow; what differs from it stands before it.
  std::vector<float> Of(const TargetImages& images, std::size_t view,
                        std::span<const float> floor) const;

  static constexpr float kMostOdds = 4;

 private:
  using Bins = std::vector<float>;

  std::size_t plane_;
  std::vector<std::uint16_t> bins_;  // [N,H,W]
  std::vector<Bins> odds_, shadow_;  // of each view; shadow_: how far something outside, but darker
};

}  // namespace tilegrad::train
