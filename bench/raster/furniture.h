// SPDX-License-Identifier: Apache-2.0
// Real meshes to render: models of Debian's sweethome3d-furniture.
#pragma once

#include <string>
#include <vector>

#include "scene/mesh.h"
#include "tilegrad/status.h"

namespace tilegrad::bench {

struct FurnitureMesh {
  std::string name;  // of the class
  Mesh mesh;         // in the box of the training's models
};

// The first model of the classes chair, car and plant, as `tilegrad dataset` finds them. An error
// where the package is not installed.
Result<std::vector<FurnitureMesh>> LoadFurniture();

}  // namespace tilegrad::bench
