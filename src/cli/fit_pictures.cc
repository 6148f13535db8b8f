// SPDX-License-Identifier: Apache-2.0
#include "cli/fit_pictures.h"

#include <fmt/core.h>

#include "cli/console.h"
#include "fit/colmap_run.h"

namespace tilegrad::cli {

train::InputOptions InputOptionsOf(const FitPictures& pictures, int hold_out, const Watch& watch) {
  // OneOf has checked it.
  return {hold_out,     *train::BackgroundNamed(pictures.background),
          pictures.fov, pictures.up,
          watch,        pictures.masks};
}

void AddPictureOptions(Command* command, FitPictures* o) {
  command->Add(
      "--background", &o->background,
      "where masks come from: the images' alpha or masks (mask), their plain backgrounds "
      "(plain), what all views have in common (views), the first if there are any (auto); none: "
      "every pixel shows the object",
      {OneOf{{"auto", "mask", "plain", "none", "views"}}});
  command->Add(
      "--masks", &o->masks,
      "a folder of masks, NAME.png for each image, instead of the images' own: such as the "
      "masks/ of an earlier fit, corrected by hand",
      {Excludes{{"--background", "--model"}}});
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

Status TryColmap(const FitPictures& pictures, const Path& folder, const Watch& watch) {
  if (pictures.find_cameras || !train::MayRunColmap(folder)) return {};
  const auto tell = [](const std::string& command) { PrintNote("tilegrad: {}\n", command); };
  const auto found = train::RunColmap(folder, tell, watch);
  if (found.status().code() == StatusCode::kCancelled) return found.status();
  if (!found.ok()) {
    PrintNote("tilegrad: warning: {}\n", found.status().message());
    return {};
  }
  PrintNote("tilegrad: COLMAP placed {} of {} images{}{}\n", found->placed.size(),
            found->placed.size() + found->missing.size(),
            found->missing.empty() ? "" : "; take more from between these and the others: ",
            fmt::join(found->missing, " "));
  return {};
}

}  // namespace tilegrad::cli
