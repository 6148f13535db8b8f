// SPDX-License-Identifier: Apache-2.0
// tilegrad fit: what pictures need that lack masks or cameras.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "fit/run.h"

namespace tilegrad::cli {

struct FitPictures {
  std::string background = "auto";
  double fov = train::kUsualFov;
  bool find_cameras = false;
};
void AddPictureOptions(CLI::App* command, FitPictures* pictures);
train::InputOptions InputOptionsOf(const FitPictures& pictures, int hold_out);

// Warnings of the input from the `first` on, a few of them.
void PrintWarnings(const train::FitInput& input, std::size_t first);

// Cameras of images that came without, or that are not to be believed; else, where cameras are to
// be fitted together with a shape, better ones to start from.
struct CameraSearch {
  const FitPictures& pictures;
  bool resume = false;  // reads what an earlier call found
};
Status StartCameras(const CameraSearch& search, train::FitJob* job, const Workers& workers,
                    const ProgressSink& progress);

}  // namespace tilegrad::cli
