// SPDX-License-Identifier: Apache-2.0
// Where the masks of an input come from.
#include <algorithm>

#include "base/error.h"
#include "fit/background.h"
#include "fit/input.h"

namespace tilegrad::train {

bool HasAlpha(const FitInput& input) {
  return std::ranges::any_of(input.images.alpha, [](float a) { return a < 1; });
}

void TakePlainBackgrounds(FitInput* input) {
  TargetImages& all = input->images;
  for (std::size_t n = 0; n < input->names.size(); ++n) {
    const auto color = std::span(all.color).subspan(3 * n * all.pixels(), 3 * all.pixels());
    const BackgroundMask mask = MaskFromPlainBackground(color, all.width, all.height);
    std::ranges::copy(mask.alpha,
                      all.alpha.begin() + static_cast<std::ptrdiff_t>(n * all.pixels()));
    if (!mask.doubt.empty()) {
      input->warnings.push_back(fmt::format("{}: {}", input->names[n], mask.doubt));
    }
  }
}

void ApplyBackground(Background background, FitInput* input) {
  if (background == Background::kNone) std::ranges::fill(input->images.alpha, 1.0f);
  const bool looks = background == Background::kAuto && !HasAlpha(*input);
  if (background != Background::kPlain && !looks) return;
  FitInput masked = *input;
  TakePlainBackgrounds(&masked);
  // Backgrounds that are not plain make no masks unless somebody says so.
  if (looks && 2 * masked.warnings.size() > masked.names.size()) return;
  *input = std::move(masked);
}

}  // namespace tilegrad::train
