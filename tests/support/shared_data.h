// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include "base/file.h"
#include "support/source_dir.h"

namespace tilegrad {

// A file of the independent test data, which is not part of the project: below the folder that
// TILEGRAD_SHARED names, else in "shared" beside or above the source folder. Nothing where it is
// absent; such tests skip and say so.
inline std::optional<Path> SharedFile(const std::string& name) {
  const Path root = TILEGRAD_SOURCE_DIR;
  std::vector<Path> places = {root / "../shared", root / "../../shared"};
  if (const char* set = std::getenv("TILEGRAD_SHARED")) places.insert(places.begin(), set);
  for (const Path& place : places) {
    std::error_code error;
    if (std::filesystem::exists(place / name, error)) return place / name;
  }
  return std::nullopt;
}

}  // namespace tilegrad
