// SPDX-License-Identifier: Apache-2.0
// The options of `tilegrad fit` that describe its pictures.
#pragma once

#include <optional>
#include <string>

#include "cli/command.h"
#include "fit/input.h"

namespace tilegrad::cli {

struct FitPictures {
  std::string background = "auto", masks;
  double fov = train::kUsualFov;
  int image_side = train::kUsualSide;
  bool find_cameras = false;
  std::optional<UpAxis> up;
};

train::InputOptions InputOptionsOf(const FitPictures& pictures, int hold_out, const Watch& watch);
void AddPictureOptions(Command* command, FitPictures* o);

// Finds cameras with COLMAP, if installed, for a folder of pictures alone. Prints which it cannot
// place, or why it fails; then the fit's own search follows.
Status TryColmap(const FitPictures& pictures, const Path& folder, const Watch& watch);

}  // namespace tilegrad::cli
