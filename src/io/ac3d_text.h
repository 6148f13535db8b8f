// SPDX-License-Identifier: Apache-2.0
// Internal to io: lines and numbers of AC3D text, and its materials.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "io/text_scan.h"
#include "scene/mesh.h"

namespace tilegrad::io {

class Ac3dText {
 public:
  // `place` stands in error messages.
  Ac3dText(std::string place, std::string_view text) : place_(std::move(place)), lines_(text) {}

  const std::string& place() const { return place_; }
  bool NextRaw(std::string_view& line) { return lines_.Next(line); }
  // The next line that is not empty.
  bool Next(std::string_view& line);
  Status Error(std::string_view what) const;

  // Takes `count` finite numbers off `rest`; `what` they are stands in the error.
  template <class T>
  Status Numbers(std::string_view& rest, T* values, int count, const char* what) const {
    for (int i = 0; i < count; ++i) {
      if (!ParseNumber(NextToken(rest), values[i]))
        return Error(fmt::format("{} needs {} finite number{}", what, count, count > 1 ? "s" : ""));
    }
    return {};
  }

  // What follows MATERIAL on its line.
  Result<Material> ReadMaterial(std::string_view rest);
  // What follows MAT, in version 12 of the format: one line a property, up to ENDMAT.
  Result<Material> ReadMaterialBlock(std::string_view rest);
  // Whether any of these shines by itself.
  bool emits() const { return emits_; }

 private:
  Status MaterialValues(std::string_view rest, Material& material);

  const std::string place_;
  Lines lines_;
  bool emits_ = false;
};

// The next token, or a quoted string, which may contain spaces.
std::string_view NextAc3dString(std::string_view& rest);

}  // namespace tilegrad::io
