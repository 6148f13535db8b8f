// SPDX-License-Identifier: Apache-2.0
// Internal to io: the header of a PLY file.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/stored_number.h"
#include "tilegrad/status.h"

namespace tilegrad::io {

struct PlyProperty {
  std::string name;
  StoredType type;
  std::optional<StoredType> count_type;  // set for a list, which begins with its length
};

struct PlyElement {
  std::string name;
  std::size_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  enum class Encoding { kText, kLittleEndian, kBigEndian } encoding = Encoding::kText;
  std::vector<PlyElement> elements;
  std::vector<std::string> textures;  // of each "comment TextureFile NAME"
  std::string_view data;              // what follows the header

  // The number of rows of an element, 0 if there is none of that name.
  std::size_t CountOf(std::string_view element) const;
};

// Errors name `place` and the line; an element with more rows than the data could hold is one.
Result<PlyHeader> ParsePlyHeader(std::string_view file, const std::string& place);

}  // namespace tilegrad::io
