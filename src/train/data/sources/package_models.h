// SPDX-License-Identifier: Apache-2.0
// Models of Debian packages, by our lists data/planes.tsv and its siblings: `class`, `shape`
// (unique id), `name`, `package`, `licence`, `model` (file in the package), `front` and `up` (file
// axes that become +z and +y), `with` and `without` (other files of the model, objects that are no
// part of it, separated by '|'), `textures` (package_textures.h), `wheels`. The lists omit
// non-vehicles, copies, and broken models.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "train/data/sources/model_source.h"

namespace tilegrad::train {

// The texts of data/planes.tsv, data/ships.tsv, data/cars.tsv.
std::string_view PlanesList();
std::string_view ShipsList();
std::string_view CarsList();

struct PackageList {
  std::string name;       // of the source
  std::string_view text;  // tab-separated, with a line of headings
  // Objects whose names contain one of these, in lower case, are no part of a model.
  std::vector<std::string_view> without;
};

// As PlanesSource and its siblings.
Result<std::unique_ptr<ModelSource>> PackageModels(const PackageList& list, const Path& games);

}  // namespace tilegrad::train
