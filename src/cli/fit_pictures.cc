// SPDX-License-Identifier: Apache-2.0
#include "cli/fit_pictures.h"

#include <fmt/core.h>

#include "cli/console.h"
#include "fit/colmap_run.h"

namespace tilegrad::cli {

train::InputOptions InputOptionsOf(const FitPictures& pictures, int hold_out, const Watch& watch) {
  // OneOf has checked it.
  return {.hold_out = hold_out,
          .background = *train::BackgroundNamed(pictures.background),
          .fov = pictures.fov,
          .up = pictures.up,
          .watch = watch,
          .masks = pictures.masks,
          .image_side = pictures.image_side};
}

void AddPictureOptions(Command* command, FitPictures* o) {
  command->Add(
      "--background", &o->background,
      "source of the masks: mask (alpha channels or mask files), plain (segmented from a plain "
      "background), views (what the views of known cameras have in common), auto (the first of "
      "these that is available), none (the object fills the image)",
      {OneOf{{"auto", "mask", "plain", "none", "views"}}});
  command->Add(
      "--masks", &o->masks,
      "folder of masks, NAME.png for each image, that replace the images' own; for example "
      "the masks/ of an earlier fit, corrected by hand",
      {Excludes{{"--background", "--model"}}});
  command->Add(
      "--find-cameras", &o->find_cameras,
      "estimate the cameras even if the folder has some; those then serve as ground truth");
  command->Add("--up",
               Choice<std::optional<UpAxis>>(
                   &o->up, {{"y", UpAxis::kY}, {"z", UpAxis::kZ}, {"x", UpAxis::kX}}),
               "up axis of the camera coordinates; the result is rotated to y up, as glTF requires "
               "[detected from the cameras, else y]",
               {Excludes{{"--model"}}});
  command->Add("--fov", &o->fov,
               "field of view of images without cameras along their longer side, degrees",
               {Range{5, 150}});
  command->Add("--image-side", &o->image_side,
               "images with more pixels along their longer side are reduced by a whole factor; 0: "
               "none are",
               {NotNegative()});
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
  PrintNote("tilegrad: COLMAP placed {} of {} images{}{}{}\n", found->placed.size(),
            found->placed.size() + found->missing.size(),
            found->error ? fmt::format(", to {:.2f} pixels", *found->error) : "",
            found->missing.empty() ? "" : "; take more from between these and the others: ",
            fmt::join(found->missing, " "));
  return {};
}

}  // namespace tilegrad::cli
