// SPDX-License-Identifier: Apache-2.0
// Of tilegrad fit: what it is told about its pictures.
#pragma once

#include <optional>
#include <string>

#include "cli/command.h"
#include "fit/input.h"

namespace tilegrad::cli {

struct FitPictures {
  std::string background = "auto", masks;
  double fov = train::kUsualFov;
  bool find_cameras = false;
  std::optional<UpAxis> up;
};

train::InputOptions InputOptionsOf(const FitPictures& pictures, int hold_out, const Watch& watch);
void AddPictureOptions(Command* command, FitPictures* o);

// Cameras of pictures alone, by COLMAP where it is installed; what it does not place, and where it
// fails, is said, and the fit's own search comes next.
Status TryColmap(const FitPictures& pictures, const Path& folder, const Watch& watch);

}  // namespace tilegrad::cli
