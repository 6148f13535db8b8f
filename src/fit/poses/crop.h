// SPDX-License-Identifier: Apache-2.0
// What a picture shows of an object, whatever its place and size there: the square around the mask,
// at few pixels. Two views of an object from the same direction have nearly the same crop.
#pragma once

#include <array>
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

// What a search for cameras knows of its pictures.
struct PosePictures {
  TargetImages images;         // of few pixels
  std::vector<Camera> lenses;  // intrinsics of such a picture; their poses mean nothing
  std::vector<Crop> crops;     // of the pictures as they came
  std::array<float, 3> mean_color = {};
  double color_weight = 1;  // of the L1 difference of colours beside 1 - IoU
};

// Pictures of about `side` pixels along their longer side: a whole number of pixels becomes one,
// and what is left over at the right and below is cut off. `lenses`: intrinsics of each. An error
// names the first picture that shows no object.
Result<PosePictures> PreparePictures(const TargetImages& images, std::span<const Camera> lenses,
                                     int side);

// How unlike any two pictures are, [N,N], in units of the median.
std::vector<double> Unlikeness(const PosePictures& pictures);

}  // namespace tilegrad::train
