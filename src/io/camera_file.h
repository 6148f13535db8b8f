// SPDX-License-Identifier: Apache-2.0
// Camera files: COLMAP models (a folder with cameras and images, .txt or .bin), NeRF's
// transforms.json, and OpenCV parameters in a JSON file:
//
//   {"width": 640, "height": 480,
//    "K": [[500, 0, 319.5], [0, 500, 239.5], [0, 0, 1]],
//    "dist": [0, 0, 0, 0, 0],                            (optional; anything but zeros is refused)
//    "frames": [{"name": "0001", "world_to_camera": [[...4 numbers], ...3 or 4 rows]},
//               {"name": "0002", "R": [[...]], "t": [...]},
//               {"name": "0003", "rvec": [...], "tvec": [...], "K": ..., "width": ...}]}
//
// Frames inherit what they omit from the top level; a file without "frames" is one camera. Lens
// distortion is an error that explains how to undistort, since the renderer has none. Cameras
// without images may be of any kind.
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
  std::string name;  // from the file, or its number
  Camera64 camera;
  ImageSize size;            // of the image
  LensDistortion lens = {};  // kStraight unless the options ask for distortion
};

// An error that says what to do if the lens has distortion.
Status CheckStraight(const LensDistortion& lens);

struct CameraFileOptions {
  ImageSize size = {};  // if the file has none; 0 x 0: it must have one
  PixelCentre opencv_centre = PixelCentre::kInteger;  // of K in OpenCV's JSON
  bool bent = false;           // return COLMAP's lens distortion instead of refusing it
  WarningSink warn = nullptr;  // receives COLMAP models that were not read
};

// Chooses the format by content: a folder is COLMAP's, a JSON file with K is OpenCV's, else NeRF's.
// Errors name the file and the line or frame. At least one camera.
Result<std::vector<CameraView>> LoadCameras(const Path& path, const CameraFileOptions& options);

struct ColmapModel {
  Path folder;
  std::string note;  // a message about other models that were ignored; or empty
};
// Finds the COLMAP model in `folder`, itself a model or a project with models (sparse/0,
// colmap/sparse/0, ...); nullopt if there is none. Of several in sparse/ takes the one with the
// most images.
std::optional<ColmapModel> FindColmapModel(const Path& folder);

// Loads the model that FindColmapModel finds; sizes and pixel centres need no options.
Result<std::vector<CameraView>> LoadColmapCameras(const Path& folder,
                                                  const CameraFileOptions& options = {});

// The mean distance, in pixels, between the points of a binary COLMAP model and where its images
// see them; none if the model has no points.
std::optional<double> ColmapPointError(const Path& folder);

// Writers for what LoadCameras reads; numbers round-trip exactly.
Status SaveColmapCameras(const Path& folder, std::span<const CameraView> views);  // text
std::vector<Path> ColmapFiles(const Path& folder);  // written by SaveColmapCameras
Status SaveNerfCameras(const Path& file, std::span<const CameraView> views);
Status SaveOpenCvCameras(const Path& file, std::span<const CameraView> views);

// The only reader of NeRF's transforms.json.
//
//   {"camera_angle_x": 0.7,                            or fl_x, fl_y, cx, cy, w, h; and a lens
//    "frames": [{"file_path": "images/000.png", "mask_path": "masks/000.png",
//                "transform_matrix": [[4 numbers] x 4]}, ...]}
//
// Angles in radians, lengths in pixels of an image of w x h. Values of a frame override those of
// the file; a frame with its own focal length, in pixels or as an angle, inherits none. null counts
// as absent, 0 is a value.

struct NerfFrame {
  std::string place;                       // "transforms.json: frame 3", for messages
  std::optional<std::string> image, mask;  // file_path, mask_path, as in the file
  Mat4Array camera_to_world = {};
  std::optional<double> fl_x, fl_y, cx, cy;  // pixels
  std::optional<double> angle_x, angle_y;    // radians, the full field of view
  std::optional<ImageSize> size;             // of the image that these refer to
  LensDistortion lens;                       // k1, k2, k3, p1, p2, camera_model, is_fisheye, ...
};

// Errors name the file, the frame and the key. At least one frame.
Result<std::vector<NerfFrame>> ReadNerfFrames(const Path& file);

// The camera for an image of `size` pixels, to which the frame's values refer.
Result<Camera64> CameraOf(const NerfFrame& frame, ImageSize size);

// Replaces the backslashes of Windows paths ("images\\0001.png") by slashes.
std::string PortablePath(std::string path);

}  // namespace tilegrad::io
