// SPDX-License-Identifier: Apache-2.0
// Where the masks of an input come from.
#include <algorithm>
#include <array>

#include "base/error.h"
#include "fit/background.h"
#include "fit/input.h"

namespace tilegrad::train {

std::optional<Background> BackgroundNamed(std::string_view name) {
  constexpr std::array<std::string_view, 4> kNames = {"auto", "mask", "plain", "none"};
  const auto at = std::ranges::find(kNames, name);
  if (at == kNames.end()) return std::nullopt;
  return static_cast<Background>(at - kNames.begin());
}

bool HasAlpha(const FitInput& input) {
  return std::ranges::any_of(input.images.alpha, [](float a) { return a < 1; });
}

Status TakePlainBackgrounds(FitInput* input, const Watch& watch) {
  TargetImages& all = input->images;
  for (std::size_t n = 0; n < input->names.size(); ++n) {
    TILEGRAD_TRY(watch.At({"looking for plain backgrounds", n, input->names.size(), ""}));
    const auto color = std::span(all.color).subspan(3 * n * all.pixels(), 3 * all.pixels());
    const BackgroundMask mask = MaskFromPlainBackground(color, all.width, all.height);
    std::ranges::copy(mask.alpha,
                      all.alpha.begin() + static_cast<std::ptrdiff_t>(n * all.pixels()));
    if (!mask.doubt.empty()) {
      input->warnings.push_back(fmt::format("{}: {}", input->names[n], mask.doubt));
    }
  }
  return watch.At({"looking for plain backgrounds", input->names.size(), input->names.size(), ""});
}

namespace {

Status LookForPlainBackgrounds(bool asked, FitInput* input, const Watch& watch) {
  FitInput masked = *input;
  TILEGRAD_TRY(TakePlainBackgrounds(&masked, watch));
  // Backgrounds that are not plain make no masks unless somebody says so.
  if (asked || 2 * masked.warnings.size() <= masked.names.size()) *input = std::move(masked);
  return {};
}

}  // namespace

Status ApplyBackground(Background background, FitInput* input, const Watch& watch) {
  if (background == Background::kNone) std::ranges::fill(input->images.alpha, 1.0f);
  const bool asked = background == Background::kPlain;
  if (asked || (background == Background::kAuto && !HasAlpha(*input))) {
    TILEGRAD_TRY(LookForPlainBackgrounds(asked, input, watch));
  }
  input->masked = HasAlpha(*input);
  return {};
}

}  // namespace tilegrad::train
