// SPDX-License-Identifier: Apache-2.0
// Models of Debian packages, by our lists data/planes.tsv and its siblings: `class`, `shape`
// (unique id), `name`, `package`, `licence`, `model` (file in the package), `front` and `up` (file
// axes that become +z and +y), `with` and `without` (other files of the model, objects that are no
// part of it, separated by '|'), `textures` (FindTextureSets), `wheels`. The lists omit
// non-vehicles, copies, and broken models.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "train/data/sources/model_source.h"

namespace tilegrad::train {

// The texts of data/sweethome3d_classes.tsv (columns: docs/datasets.md), planes.tsv, ships.tsv and
// cars.tsv.
std::string_view SweetHome3dList();
std::string_view PlanesList();
std::string_view ShipsList();
std::string_view CarsList();

struct PackageList {
  std::string name;       // of the source
  std::string_view text;  // tab-separated, with a line of headings
  // Objects whose names contain one of these, in lower case, are no part of a model.
  std::vector<std::string_view> without;
};

struct TextureSet {
  std::string name;    // empty: the model's own
  std::string folder;  // its images replace those of the same name; empty: none
  std::string image;   // replaces every image of the model; empty: none
};

// Parses a list's column `textures`: parts separated by '|', all relative to `archive`:
//   nothing or "."   the model's own
//   "a/b.png"        those in the folder a
//   "a/*/b.png"      a set for each folder below a that holds b.png; named by what '*' matches
//   "=a/b.png"       this image
// Sorted as written; a pattern's sets by name. A pattern without a match gives none.
std::vector<TextureSet> FindTextureSets(std::string_view column, const Path& archive);

// As PlanesSource and its siblings.
Result<std::unique_ptr<ModelSource>> PackageModels(const PackageList& list, const Path& games);

}  // namespace tilegrad::train
