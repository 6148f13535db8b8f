// SPDX-License-Identifier: Apache-2.0
// What a fit is given: images with masks, and their cameras.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/file.h"
#include "fit/image_loss.h"
#include "scene/camera.h"
#include "scene/mesh.h"

namespace tilegrad::train {

struct FitInput {
  std::vector<std::string> names;  // of the views, for messages
  std::vector<Camera> cameras;
  TargetImages images;                  // straight colours (not multiplied by alpha)
  std::vector<int> training, held_out;  // indices of views; every view is in one of them
  bool masked = false;                  // some image says where the object is

  // Of a dataset, what is known of the truth: occupancy at kOccupancyResolution. Else empty.
  std::vector<std::uint8_t> occupancy;
};

// A folder with transforms.json, or transforms_train.json, or a COLMAP project. Views of
// transforms_test.json beside it, if it is there, are held out; otherwise every `hold_out`-th (0:
// none). An image's mask is its alpha, or the mask_path of its frame (grey or alpha). All images
// must have one size. Errors name the file.
Result<FitInput> ReadFitFolder(const Path& folder, int hold_out);

// One model of a dataset (train/data/dataset.h), named "CLASS/ID".
Result<FitInput> ReadFitDataset(const Path& folder, const std::string& model, int hold_out);

// Images as datasets and PrepareCutout have them, bytes of [views][4][size][size] with RGB over
// black.
TargetImages TargetsOfPlanar(std::span<const std::uint8_t> bytes, int size);

// Means over squares of `factor` pixels; colours weighted by alpha. The sides must be multiples of
// `factor`.
TargetImages Reduce(const TargetImages& images, int factor);

// The sphere that looks from all training views about as large as the object: around the point
// closest to all their optical axes, of the radius that gives the mean area of the masks. An error
// if that is nowhere in front of the cameras.
struct Sphere {
  glm::vec3 centre = {0, 0, 0};
  float radius = 1;
};
Result<Sphere> GuessSphere(const FitInput& input);

}  // namespace tilegrad::train
