// SPDX-License-Identifier: Apache-2.0
// Converts users' own pictures to the form of training images.
#pragma once

#include <cstdint>
#include <vector>

#include "scene/image.h"
#include "tilegrad/status.h"

namespace tilegrad::train {

enum class Framing {
  kFit,   // centres and scales the object as in training renders
  kKeep,  // only resizes: the picture is framed like a training image already
};

// image: with straight alpha, RGBA or grey. Returns planar [4][size][size] bytes, RGB composited
// over black, by area averaging. With Framing::kFit the longer side of the mask's bounding box
// (alpha >= 1/2) gets kTrainingFill of the image. An error where no pixel is opaque, or where all
// are (then there is no cut-out).
Result<std::vector<std::uint8_t>> PrepareCutout(const ImageU8& image, int size, Framing framing);

// The share of the image that a normalised object's longest side spans before CameraRule's default
// camera: half_extent / (distance tan(fov_y / 2)) = 0.45 / (1.45 * 0.4571).
inline constexpr double kTrainingFill = 0.679;

// The object's share of each pixel, 255 inside: alpha if any of the picture is transparent; else
// the first channel as grey, since programs save masks in RGBA files, too.
std::vector<std::uint8_t> MaskValues(const ImageU8& mask);

// Sets a mask as the alpha of an RGB image of the same size; other sizes are an error that names
// both.
Result<ImageU8> WithMask(const ImageU8& rgb, const ImageU8& mask);

}  // namespace tilegrad::train
