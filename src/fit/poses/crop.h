// SPDX-License-Identifier: Apache-2.0
// What a picture shows of an object, whatever its place and size there: the square around the mask,
// at few pixels. Two views of an object from the same direction have nearly the same crop.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "fit/image_loss.h"
#include "scene/camera.h"

namespace tilegrad::train {

inline constexpr int kCropSide = 32;
inline constexpr std::size_t kCropPixels = std::size_t{kCropSide} * kCropSide;

struct Crop {
  // Where the square is, in units of the focal length: the middle is seen along (x, y, -1), camera
  // axes.
  double x = 0, y = 0, side = 0;
  std::vector<float> alpha, color;  // [S,S], [3,S,S] times alpha
};

// One image in planes; `color` times `alpha` is what is seen.
struct CropSource {
  int width = 0, height = 0;
  std::span<const float> color, alpha;  // [3,H,W], [H,W]
};
// None where nothing is opaque.
std::optional<Crop> CropOf(const CropSource& image, const Camera& camera);

// How unlike two crops are: 1 - IoU of the masks, plus `color_weight` times the mean |difference|
// of colours where both show the object.
double CropCost(const Crop& a, const Crop& b, double color_weight);

// `seen` is the crop of an object at the origin of the world from `from`, which looks along -z at
// it from some distance. The camera with the lens of `from` that sees it at the place and size of
// `wanted`, from the same direction.
Camera Aligned(const Crop& seen, const Crop& wanted, const Camera& from);

}  // namespace tilegrad::train
