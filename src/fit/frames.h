// SPDX-License-Identifier: Apache-2.0
// Images and their cameras, as the folders that a fit reads name them (io/camera_file.h).
#pragma once

#include <optional>
#include <vector>

#include "base/file.h"
#include "io/camera_file.h"
#include "scene/camera.h"
#include "tilegrad/status.h"

namespace tilegrad::train {

struct InputFrame {
  Path image, mask;           // whole paths; mask is empty where there is none
  bool stored_order = false;  // pixels are counted as the image stores them (io/image_file.h)
  io::NerfFrame camera;
  double angle_long = 0;  // radians along the longer side, where no focal length is known; else 0
};

// Of transforms.json. file_path and mask_path count from its folder; an ending of ".png" may be
// left out. If no frame has mask_path, images in a folder "images" have their masks as below.
// Errors name the file, the frame and the key.
Result<std::vector<InputFrame>> ReadTransforms(const Path& file);

// The camera of a frame whose image has this size, without what its lens bends. An error says why
// nothing can be fitted with it.
Result<Camera> CameraOfFrame(const InputFrame& frame, ImageSize image);

// One camera an image; `images` are relative to the folder of the file.
struct OutputFrame {
  std::string image;
  Camera camera;
  double gain = 1;  // of exposure; written as "exposure_gain" where it is not 1
  std::optional<ImageSize> size = std::nullopt;  // where it is not that of the file
};

std::string WriteTransforms(const std::vector<OutputFrame>& views, ImageSize size);

// Cameras are kept as floats, and a fit divides and multiplies by their numbers: an error says
// which of these is beyond what that bears, of images of this size. Also those of Validate.
Status CheckCamera(const Camera64& camera, ImageSize image);

// A COLMAP project: its cameras, the images that they belong to, and masks beside these.
//
//   <project>/sparse/0/cameras.txt, images.txt   or .bin; the largest of several models; also
//                                                <project>/sparse, <project>, and colmap/ before
//                                                them, as nerfstudio has it
//   <project>/images/a/1.jpg
//   <project>/masks/a/1.jpg.png                  as COLMAP names masks, or masks/a/1.png
//
// Images are looked for in folders `images`, and by their names alone, beside the model and up to
// two folders above it. Errors name the file.
Result<std::vector<InputFrame>> ReadColmapFrames(const Path& model);

inline constexpr double kUsualFov = 65;  // degrees along the longer side: main cameras of phones

// Without a picture: a lens that sees `fov` degrees along the longer side, and a pose that means
// nothing.
InputFrame BareFrame(double fov);

// A folder of pictures without cameras; empty if there are none. Warns of pictures in formats that
// are not read.
//
//   <folder>/images/a.jpg or <folder>/a.jpg     PNG, JPEG or WebP, in the order of their names
//   <folder>/masks/a.jpg.png or masks/a.png     beside images/ or in <folder>
std::vector<InputFrame> ReadBareFrames(const Path& folder, double fov,
                                       std::vector<std::string>* warnings);

}  // namespace tilegrad::train
