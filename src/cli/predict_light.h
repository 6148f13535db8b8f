// SPDX-License-Identifier: Apache-2.0
// What predict does with the light that a network of textures and light says.
#pragma once

#include <optional>

#include "base/file.h"
#include "base/progress.h"
#include "train/predictor.h"
#include "train/tasks/textured_image/model.h"

namespace tilegrad::cli {

// Whether its network says a light.
bool PredictsLight(const train::Predictor& predictor);
// Of one picture, [4][size][size] planar bytes; nothing where the network says no light, or no
// camera that it is in the axes of.
Result<std::optional<train::PredictedObject>> PredictLit(const train::Predictor& predictor,
                                                         std::span<const std::uint8_t> picture);

// Unit, in the mesh's axes, towards the light.
glm::dvec3 SunOf(const train::PredictedObject& object, const train::LightConfig& light);

// `mesh` from where its picture was taken, once around under a light as far from the camera's axis
// as the predicted one, from where that is: an animated WebP that loops.
struct Relighting {
  const train::PredictedObject& object;
  const train::LightConfig& light;
  int size;  // pixels a side of the network's pictures
  const Watch& watch;
};
Status AnimateRelighting(const Mesh& mesh, const Relighting& job, const Path& file);

}  // namespace tilegrad::cli
