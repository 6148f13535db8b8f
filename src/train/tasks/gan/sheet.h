// SPDX-License-Identifier: Apache-2.0
// Pictures of generated objects for people: under the light of datasets.
#pragma once

#include <span>
#include <vector>

#include "base/parallel.h"
#include "scene/camera.h"
#include "scene/image.h"
#include "scene/mesh.h"
#include "tilegrad/status.h"

namespace tilegrad::train {

struct SheetLook {
  int size = 128;      // pixels a side of each picture
  int columns = 8;     // pictures a row
  bool behind = true;  // also from behind: two pictures to an object
};

// From in front and above, turned by `azimuth` degrees more.
Camera SheetCamera(int size, double azimuth);
// A picture for each mesh.
Result<std::vector<ImageU8>> DrawObjects(std::span<const Mesh> meshes, const Camera& camera,
                                         int size, const Workers& workers);
Result<ImageU8> DrawSheet(std::span<const Mesh> meshes, const SheetLook& look,
                          const Workers& workers);

}  // namespace tilegrad::train
