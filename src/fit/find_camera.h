// SPDX-License-Identifier: Apache-2.0
// From where a picture shows a mesh: tried from all around, by silhouette and colour.
#pragma once

#include <vector>

#include "fit/image_loss.h"
#include "fit/scene.h"
#include "train/data/dataset.h"

namespace tilegrad::train {

struct FoundCamera {
  Camera camera{};
  double azimuth = 0, elevation = 0;  // degrees, of the orbit it began as
  double silhouette_iou = 0, color_l1 = 0;
  double cost() const { return 1 - silhouette_iou + color_l1; }
};

// Cameras of the rule's lens and distance around `scene` at several elevations, each moved and
// brought nearer until the mesh fills the picture's bounding box; best first. `picture`: one image.
// An error where the picture shows no object.
Result<std::vector<FoundCamera>> FindCameras(const FitScene& scene, const TargetImages& picture,
                                             const CameraRule& rule, const Workers& workers);

}  // namespace tilegrad::train
