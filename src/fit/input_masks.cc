// SPDX-License-Identifier: Apache-2.0
// Where the masks of an input come from.
#include <algorithm>
#include <array>

#include "base/error.h"
#include "fit/background.h"
#include "fit/input.h"

namespace tilegrad::train {

std::optional<Background> BackgroundNamed(std::string_view name) {
  constexpr std::array<std::string_view, 5> kNames = {"auto", "mask", "plain", "none", "views"};
  const auto at = std::ranges::find(kNames, name);
  if (at == kNames.end()) return std::nullopt;
  return static_cast<Background>(at - kNames.begin());
}

bool HasAlpha(const FitInput& input) {
  return std::ranges::any_of(input.images.alpha, [](float a) { return a < 1; });
}

Status TakePlainBackgrounds(FitInput* input, const Watch& watch) {
  TargetImages& all = input->images;
  std::size_t doubts = 0;
  for (std::size_t n = 0; n < input->names.size(); ++n) {
    TILEGRAD_TRY(watch.At({"looking for plain backgrounds", n, input->names.size(), ""}));
    const auto color = std::span(all.color).subspan(3 * n * all.pixels(), 3 * all.pixels());
    const BackgroundMask mask = MaskFromPlainBackground(color, all.width, all.height);
    std::ranges::copy(mask.alpha,
                      all.alpha.begin() + static_cast<std::ptrdiff_t>(n * all.pixels()));
    if (!mask.doubt.empty()) {
      ++doubts;
      input->warnings.push_back(fmt::format("{}: {}", input->names[n], mask.doubt));
    }
  }
  input->masks_found = true;
  input->notes.push_back(fmt::format("masks: cut from plain backgrounds; {} of {} are in doubt",
                                     doubts, input->names.size()));
  return watch.At({"looking for plain backgrounds", input->names.size(), input->names.size(), ""});
}

namespace {

// Keeps them where at most so many views are in doubt.
Status LookForPlainBackgrounds(std::size_t most_doubts, FitInput* input, const Watch& watch) {
  FitInput masked = *input;
  TILEGRAD_TRY(TakePlainBackgrounds(&masked, watch));
  const std::size_t doubts = masked.warnings.size() - input->warnings.size();
  if (doubts <= most_doubts) *input = std::move(masked);
  return {};
}

constexpr float kObjectAlpha = 0.5f;  // alpha of what the hull takes for the object

template <class Values>
void KeepPlanes(const std::vector<int>& kept, std::size_t size, Values* values) {
  Values out;
  for (const int i : kept) {
    const auto from = values->begin() + static_cast<std::ptrdiff_t>(size) * i;
    out.insert(out.end(), from, from + static_cast<std::ptrdiff_t>(size));
  }
  values->swap(out);
}

// Indices of views among those that are kept.
void Renumber(const std::vector<int>& kept, std::vector<int>* views) {
  std::vector<int> out;
  for (const int view : *views) {
    const auto at = std::ranges::lower_bound(kept, view);
    if (at != kept.end() && *at == view) out.push_back(static_cast<int>(at - kept.begin()));
  }
  views->swap(out);
}

// Some programs write 1 for white.
Status NothingInMasks(const TargetImages& all) {
  float most = 0;
  for (const float a : all.alpha) most = std::max(most, 255 * a);
  return InvalidArgument("all masks are empty: there is nothing to fit{}",
                         most > 0 ? fmt::format("; the object must be white, 255, but no mask has "
                                                "more than {:.0f}",
                                                most)
                                  : "");
}

}  // namespace

Status DropEmptyViews(FitInput* input) {
  TargetImages& all = input->images;
  std::vector<int> kept;
  for (std::size_t n = 0; n < input->names.size(); ++n) {
    const auto alpha = std::span(all.alpha).subspan(n * all.pixels(), all.pixels());
    if (std::ranges::any_of(alpha, [](float a) { return a >= kObjectAlpha; })) {
      kept.push_back(static_cast<int>(n));
    } else {
      input->warnings.push_back(input->names[n] + ": its mask is empty; the view is left out");
    }
  }
  if (kept.empty()) return NothingInMasks(all);
  if (kept.size() == input->names.size()) return {};
  KeepPlanes(kept, 3 * all.pixels(), &all.color);
  KeepPlanes(kept, all.pixels(), &all.alpha);
  KeepPlanes(kept, 1, &input->names);
  KeepPlanes(kept, 1, &input->cameras);
  Renumber(kept, &input->training);
  Renumber(kept, &input->held_out);
  Renumber(kept, &input->turned);
  return {};
}

Status SeekMasks(Background background, FitInput* input) {
  const bool asked = background == Background::kViews;
  if (asked) std::ranges::fill(input->images.alpha, 1.0f);
  const std::size_t views = input->names.size();
  input->seeks_masks = (asked || (background == Background::kAuto && !HasAlpha(*input))) &&
                       input->posed && views >= kLeastMaskViews;
  if (!asked || input->seeks_masks) return {};
  return InvalidArgument(
      "--background views takes cameras and at least {} images; there are {} images{}",
      kLeastMaskViews, views, input->posed ? "" : " without cameras");
}

Status ApplyBackground(Background background, FitInput* input, const Watch& watch) {
  if (background == Background::kNone) std::ranges::fill(input->images.alpha, 1.0f);
  const std::size_t views = input->names.size();
  if (background == Background::kPlain) {
    TILEGRAD_TRY(LookForPlainBackgrounds(views, input, watch));
  } else if (background == Background::kAuto && !HasAlpha(*input)) {
    // Known cameras separate more than plain backgrounds, but a plain one is found more exactly.
    TILEGRAD_TRY(LookForPlainBackgrounds(input->seeks_masks ? 0 : views / 2, input, watch));
    input->seeks_masks = input->seeks_masks && !HasAlpha(*input);
  }
  input->masked = HasAlpha(*input);
  return {};
}

}  // namespace tilegrad::train
