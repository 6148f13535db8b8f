// SPDX-License-Identifier: Apache-2.0
#include "cli/fit_pictures.h"

#include <algorithm>

#include "cli/console.h"

namespace tilegrad::cli {
train::InputOptions InputOptionsOf(const FitPictures& pictures, int hold_out, const Watch& watch) {
  // OneOf has checked it.
  return {hold_out, *train::BackgroundNamed(pictures.background), pictures.fov, pictures.up, watch};
}

void PrintWarnings(const train::FitInput& input, std::size_t first) {
  constexpr std::size_t kShown = 3;
  const std::size_t count = input.warnings.size() - first;
  for (std::size_t i = 0; i < std::min(count, kShown); ++i) {
    PrintNote("tilegrad: warning: {}\n", input.warnings[first + i]);
  }
  if (count > kShown) PrintNote("tilegrad: warning: and {} more of these\n", count - kShown);
}

void AddPictureOptions(Command* command, FitPictures* o) {
  command->Add("--background", &o->background,
               "where masks come from: the images' alpha or masks (mask), their plain backgrounds "
               "(plain), the former if there are any (auto); none: every pixel shows the object",
               {OneOf{{"auto", "mask", "plain", "none"}}});
  command->Add(
      "--find-cameras", &o->find_cameras,
      "look for the cameras in the images, though the folder has some; these judge the result");
  command->Add("--up",
               Choice<std::optional<UpAxis>>(
                   &o->up, {{"y", UpAxis::kY}, {"z", UpAxis::kZ}, {"x", UpAxis::kX}}),
               "the axis of the cameras' world that points up: everything is turned to have y up, "
               "as glTF wants it [what the cameras make plain, else y]",
               {Excludes{{"--model"}}});
  command->Add("--fov", &o->fov, "degrees that images without cameras see along their longer side",
               {Range{5, 150}});
}

}  // namespace tilegrad::cli
