// SPDX-License-Identifier: Apache-2.0
// transforms.json of NeRF programs: the one reader of that format.
//
//   {"camera_angle_x": 0.7,                            or fl_x, fl_y, cx, cy, w, h; and a lens
//    "frames": [{"file_path": "images/000.png", "mask_path": "masks/000.png",
//                "transform_matrix": [[4 numbers] x 4]}, ...]}
//
// Angles in radians, lengths in pixels of an image of w x h. What a frame says itself goes before
// what the file says for all; a frame that has a focal length of its own, in pixels or as an angle,
// takes none from there. null is as good as nothing, 0 is a number.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/file.h"
#include "scene/lens_distortion.h"

namespace tilegrad::io {

struct NerfFrame {
  std::string place;                       // "transforms.json: frame 3", for messages
  std::optional<std::string> image, mask;  // file_path, mask_path, as they are written
  Mat4Array camera_to_world = {};
  std::optional<double> fl_x, fl_y, cx, cy;  // pixels
  std::optional<double> angle_x, angle_y;    // radians, the whole field of view
  std::optional<ImageSize> size;             // of the image that these are meant for
  LensDistortion lens;                       // k1, k2, k3, p1, p2, camera_model, is_fisheye, ...
};

// Errors name the file, the frame and the key. At least one frame.
Result<std::vector<NerfFrame>> ReadNerfFrames(const Path& file);

// The camera of an image of this many pixels, which the frame's numbers are meant for.
Result<Camera64> CameraOf(const NerfFrame& frame, ImageSize size);

// Windows programs write "images\\0001.png": with slashes, as every system reads it.
std::string PortablePath(std::string path);

}  // namespace tilegrad::io
