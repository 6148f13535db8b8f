// SPDX-License-Identifier: Apache-2.0
// Images and their cameras, as the folders that a fit reads name them (io/camera_file.h,
// fit/colmap_frames.h, fit/bare_frames.h).
#pragma once

#include <vector>

#include "base/file.h"
#include "io/camera_file.h"

namespace tilegrad::train {

struct TransformsFrame {
  Path image, mask;           // whole paths; mask is empty where there is none
  bool stored_order = false;  // pixels are counted as the image stores them (io/image_file.h)
  io::NerfFrame camera;
  double angle_long = 0;  // radians along the longer side, where no focal length is known; else 0
};

// Of transforms.json. file_path and mask_path count from its folder; an ending of ".png" may be
// left out. Errors name the file, the frame and the key.
Result<std::vector<TransformsFrame>> ReadTransforms(const Path& file);

// The camera of a frame whose image has this size, without what its lens bends. An error says why
// nothing can be fitted with it.
Result<Camera> CameraOfFrame(const TransformsFrame& frame, ImageSize image);

// One camera an image, all of one size; `images` are relative to the folder of the file.
struct TransformsView {
  std::string image;
  Camera camera;
  double gain = 1;  // of exposure; written as "exposure_gain" where it is not 1
};
std::string WriteTransforms(const std::vector<TransformsView>& views, ImageSize size);

}  // namespace tilegrad::train
