// SPDX-License-Identifier: Apache-2.0
// Cameras of images as NeRF's transforms.json holds them.
//
//   {"camera_angle_x": 0.7,                                 or fl_x, fl_y, cx, cy, w, h
//    "frames": [{"file_path": "images/000.png", "mask_path": "masks/000.png",
//                "transform_matrix": [[4 numbers] x 4]}, ...]}
//
// Angles in radians, lengths in pixels of an image of w x h (default: of the image itself; if that
// has another size, they are scaled). A frame may have intrinsics of its own. file_path and
// mask_path count from the folder of the file; an ending of ".png" may be left out.
#pragma once

#include <vector>

#include "base/file.h"
#include "scene/camera_conventions.h"

namespace tilegrad::train {

struct TransformsFrame {
  Path image, mask;           // whole paths; mask is empty where there is none
  bool stored_order = false;  // pixels are counted as the image stores them (io/orientation.h)
  NerfCamera pose;            // its intrinsics are 0 where they are not given
  double angle_x = 0, angle_y = 0;
  double angle_long = 0;  // along the longer side, where nothing else is known; else 0
  ImageSize size;         // that intrinsics are meant for; 0: of the image
};

// Errors name the file, the frame and the key.
Result<std::vector<TransformsFrame>> ReadTransforms(const Path& file);

// The camera of a frame whose image has this size.
Result<Camera> CameraOfFrame(const TransformsFrame& frame, ImageSize image);

// One camera an image, all of one size; `images` are relative to the folder of the file.
struct TransformsView {
  std::string image;
  Camera camera;
  double gain = 1;  // of exposure; written as "exposure_gain" where it is not 1
};
std::string WriteTransforms(const std::vector<TransformsView>& views, ImageSize size);

}  // namespace tilegrad::train
