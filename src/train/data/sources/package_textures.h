// SPDX-License-Identifier: Apache-2.0
// The sets of textures that one model of a package has.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "io/mesh_file.h"

namespace tilegrad::train {

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

// Loads a mesh with one of its sets of textures.
Result<io::LoadedMesh> LoadWithTextures(const io::FileSource& files, const std::string& model,
                                        const TextureSet& textures);

}  // namespace tilegrad::train
