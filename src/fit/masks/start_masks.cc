// SPDX-License-Identifier: Apache-2.0
#include "fit/masks/start_masks.h"

#include <algorithm>
#include <numeric>

#include "base/error.h"
#include "base/text.h"
#include "fit/masks/find_masks.h"
#include "fit/quarter_turn.h"
#include "fit/undistort.h"
#include "io/image_file.h"

namespace tilegrad::train {
namespace {

constexpr double kDoubtfulMask = 0.7, kNoMasks = 0.6;  // agreement of a view; of all, the mean

std::string MaskName(const FitInput& input, std::size_t view) {
  const auto end = input.names.begin() + static_cast<std::ptrdiff_t>(view);
  const bool taken = std::find(input.names.begin(), end, input.names[view]) != end;
  return taken ? fmt::format("{}-{}", view, input.names[view]) : input.names[view];
}

Result<Path> FindMask(const Path& folder, const std::string& name) {
  for (const Path& file :
       {folder / (name + ".png"), folder / Path(name).replace_extension(".png"), folder / name}) {
    if (IsFile(file)) return file;
  }
  return NotFound("{}: no such mask; every image needs one",
                  (folder / Path(name).replace_extension(".png")).string());
}

double Mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

std::string NoteOf(const FoundMasks& found, const FitInput& input) {
  const auto least = std::ranges::min_element(found.agreement);
  const auto view = static_cast<std::size_t>(least - found.agreement.begin());
  return fmt::format(
      "masks: found in {}; they agree to {:.0f} % with what all have in common, that of {} to "
      "{:.0f} %",
      Count(found.agreement.size(), "image"), 100 * Mean(found.agreement), input.names[view],
      100 * *least);
}

void Take(const FoundMasks& found, FitInput* input) {
  std::ranges::copy(found.alpha, input->images.alpha.begin());
  input->masks_found = true;
  input->mask_agreement = Mean(found.agreement);
  input->notes.push_back(NoteOf(found, *input));
  for (std::size_t v = 0; v < input->names.size(); ++v) {
    if (found.agreement[v] >= kDoubtfulMask) continue;
    input->warnings.push_back(
        fmt::format("{}: its mask is doubtful, it covers {:.0f} % of what all views have in common "
                    "or that of it; look at masks/{}.png",
                    input->names[v], 100 * found.agreement[v], MaskName(*input, v)));
  }
}

Status Find(FitInput* input, const Workers& workers, const Watch& watch) {
  TILEGRAD_ASSIGN(const FoundMasks found, FindMasks(*input, workers, watch));
  if (!(Mean(found.agreement) >= kNoMasks)) {
    input->warnings.push_back(fmt::format(
        "no masks were found in the images: they agree to {:.0f} %", 100 * Mean(found.agreement)));
    return ApplyBackground(Background::kAuto, input, watch);
  }
  Take(found, input);
  return {};
}

// The share of a view's outermost pixels that its mask covers; 0 if it covers all pixels, of which
// there is a warning already.
double BorderShare(const TargetImages& images, std::size_t view) {
  constexpr float kObject = 0.5f;
  const auto mask = std::span(images.alpha).subspan(view * images.pixels(), images.pixels());
  if (std::ranges::all_of(mask, [](float a) { return a >= 1; })) return 0;
  std::size_t covered = 0, count = 0;
  for (int y = 0; y < images.height; ++y) {
    const bool whole = y == 0 || y == images.height - 1;
    for (int x = 0; x < images.width; x += whole ? 1 : std::max(1, images.width - 1)) {
      covered += mask[static_cast<std::size_t>(y) * static_cast<std::size_t>(images.width) +
                      static_cast<std::size_t>(x)] >= kObject;
      ++count;
    }
  }
  return static_cast<double>(covered) / static_cast<double>(count);
}

// Before empty ones go.
Status KeepFound(const Path& folder, const FitInput& input) {
  return input.masks_found && !folder.empty() ? WriteMasks(folder, input) : Status();
}

}  // namespace

Status WriteMasks(const Path& folder, const FitInput& input) {
  TILEGRAD_TRY(MakeFolder(folder));
  const TargetImages& all = input.images;
  for (std::size_t v = 0; v < input.names.size(); ++v) {
    ImageU8 mask(all.width, all.height, 1);
    const auto alpha = std::span(all.alpha).subspan(v * all.pixels(), all.pixels());
    std::ranges::transform(alpha, mask.pixels.begin(),
                           [](float a) { return static_cast<std::uint8_t>(255 * a + 0.5f); });
    mask = HeldImage(input, v, std::move(mask));
    TILEGRAD_TRY(io::SavePng(folder / (MaskName(input, v) + ".png"), mask));
  }
  return {};
}

Status ReadMasks(const Path& folder, FitInput* input) {
  TargetImages& all = input->images;
  for (std::size_t v = 0; v < input->names.size(); ++v) {
    TILEGRAD_ASSIGN(const Path file, FindMask(folder, MaskName(*input, v)));
    const auto alpha = std::span(all.alpha).subspan(v * all.pixels(), all.pixels());
    const bool turned = IsTurned(*input, v);
    const ImageSize size =
        turned ? ImageSize{all.height, all.width} : ImageSize{all.width, all.height};
    TILEGRAD_TRY(LoadMask(file, size, alpha));
    if (turned) std::ranges::copy(TurnedPlanes(alpha, size), alpha.begin());
  }
  return {};
}

void DoubtBorders(FitInput* input) {
  constexpr double kBackground = 0.9, kCut = 0.02;
  std::size_t inverted = 0;
  std::vector<std::size_t> cut;
  for (std::size_t v = 0; v < input->names.size(); ++v) {
    const double share = BorderShare(input->images, v);
    inverted += share > kBackground;
    if (share > kCut) cut.push_back(v);
  }
  const std::string views = Count(input->names.size(), "image");
  if (2 * inverted > input->names.size()) {
    input->warnings.push_back(
        fmt::format("masks cover the border of {} of {}, as background does: are they inverted? "
                    "White must be the object",
                    inverted, views));
  } else if (!cut.empty()) {
    input->warnings.push_back(
        fmt::format("masks reach the border of {} of {}, such as {}: what it cuts off is a guess",
                    cut.size(), views, input->names[cut.front()]));
  }
}

Status StartMasks(bool resume, FitJob* job, const Workers& workers, const Watch& watch) {
  FitInput& input = job->input;
  const Path folder = job->out.empty() ? Path() : job->out / "masks";
  if (!input.seeks_masks) return KeepFound(folder, input);
  input.seeks_masks = false;
  if (job->config.loss.silhouette_weight == 0) {
    TILEGRAD_TRY(ApplyBackground(Background::kAuto, &input, watch));
  } else if (resume && !folder.empty() && IsFolder(folder)) {
    TILEGRAD_TRY(ReadMasks(folder, &input));
  } else {
    TILEGRAD_TRY(Find(&input, workers, watch));
    TILEGRAD_TRY(KeepFound(folder, input));
  }
  input.masked = HasAlpha(input);
  return DropEmptyViews(&input);
}

}  // namespace tilegrad::train
