// SPDX-License-Identifier: Apache-2.0
// Texture coordinates for a template sphere.
#pragma once

#include "fit/scene.h"

namespace tilegrad::train {

// Longitude and latitude: u goes once around the y axis, v from the lower pole (0) to the upper
// (1). `sphere` is centred on the origin and has the faces of `scene`. Faces that cross the seam
// run beyond u = 1, where the texture repeats; a corner at a pole has the mean u of the other two,
// so no face runs backwards through the map.
void SetSphereUv(const Mesh& sphere, FitScene* scene);

}  // namespace tilegrad::train
