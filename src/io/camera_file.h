// SPDX-License-Identifier: Apache-2.0
// Files of cameras: COLMAP's models (a folder with cameras and images, .txt or .bin), NeRF's
// transforms.json, and OpenCV's numbers in a JSON file:
//
//   {"width": 640, "height": 480,
//    "K": [[500, 0, 319.5], [0, 500, 239.5], [0, 0, 1]],
//    "dist": [0, 0, 0, 0, 0],                            (optional; anything but zeros is refused)
//    "frames": [{"name": "0001", "world_to_camera": [[...4 numbers], ...3 or 4 rows]},
//               {"name": "0002", "R": [[...]], "t": [...]},
//               {"name": "0003", "rvec": [...], "tvec": [...], "K": ..., "width": ...}]}
//
// What a frame omits is taken from the top level; a file without "frames" is one camera. Lens
// distortion is an error that explains how to remove it: the renderer's rays are straight. Cameras
// that no image uses may be of any kind.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/progress.h"
#include "scene/lens_distortion.h"

namespace tilegrad::io {

struct CameraView {
  std::string name;  // as the file says, or its number
  Camera64 camera;
  ImageSize size;            // of the image
  LensDistortion lens = {};  // straight unless the options ask for others
};

// An error, unless it is straight, that says what to do.
Status CheckStraight(const LensDistortion& lens);

struct CameraFileOptions {
  ImageSize size = {};  // where the file does not say; 0 x 0: then it must
  PixelCentre opencv_centre = PixelCentre::kInteger;  // of K in OpenCV's JSON
  bool bent = false;           // lenses of COLMAP that bend rays are given back, not refused
  WarningSink warn = nullptr;  // of COLMAP's models that are not read
};

// By what is there: a folder is COLMAP's, a JSON file with K is OpenCV's, else NeRF's. Errors name
// the file and the line or frame. At least one camera.
Result<std::vector<CameraView>> LoadCameras(const Path& path, const CameraFileOptions& options);

struct ColmapModel {
  Path folder;
  std::string note;  // which others were passed over, for people; or empty
};
// The COLMAP model in `folder`, which is the model's own or its project's (sparse/0,
// colmap/sparse/0, ...), or nothing. Of several in sparse/ the one with the most images.
std::optional<ColmapModel> FindColmapModel(const Path& folder);

// Of what FindColmapModel finds; sizes and pixel centres need no options.
Result<std::vector<CameraView>> LoadColmapCameras(const Path& folder,
                                                  const CameraFileOptions& options = {});

// Writers for what LoadCameras reads; numbers come back as they were.
Status SaveColmapCameras(const Path& folder, std::span<const CameraView> views);  // text
std::vector<Path> ColmapFiles(const Path& folder);  // that SaveColmapCameras writes
Status SaveNerfCameras(const Path& file, std::span<const CameraView> views);
Status SaveOpenCvCameras(const Path& file, std::span<const CameraView> views);

// transforms.json of NeRF programs: the one reader of that format.
//
//   {"camera_angle_x": 0.7,                            or fl_x, fl_y, cx, cy, w, h; and a lens
//    "frames": [{"file_path": "images/000.png", "mask_path": "masks/000.png",
//                "transform_matrix": [[4 numbers] x 4]}, ...]}
//
// Angles in radians, lengths in pixels of an image of w x h. What a frame says itself goes before
// what the file says for all; a frame that has a focal length of its own, in pixels or as an angle,
// takes none from there. null is as good as nothing, 0 is a number.

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
