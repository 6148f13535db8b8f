// SPDX-License-Identifier: Apache-2.0
// tilegrad fit: what pictures need that lack masks or cameras.
#pragma once

#include <optional>
#include <string>

#include "cli/command.h"
#include "fit/run.h"

namespace tilegrad::cli {

struct FitPictures {
  std::string background = "auto";
  double fov = train::kUsualFov;
  bool find_cameras = false;
  std::optional<UpAxis> up;
};
void AddPictureOptions(Command* command, FitPictures* pictures);
train::InputOptions InputOptionsOf(const FitPictures& pictures, int hold_out, const Watch& watch);

// Warnings of the input from the `first` on, a few of them.
void PrintWarnings(const train::FitInput& input, std::size_t first);

}  // namespace tilegrad::cli
