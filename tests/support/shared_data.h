// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/file.h"
#include "support/source_dir.h"

namespace tilegrad {

using Json = nlohmann::json;

// A file of the independent test data, which is not part of the project: below the folder that
// TILEGRAD_SHARED names, else in "shared" beside or above the source folder. nullopt if it is
// absent; such tests skip and say so.
inline std::optional<Json> SharedVectors(const std::string& name) {
  const Path root = TILEGRAD_SOURCE_DIR;
  std::vector<Path> places = {root / "../shared", root / "../../shared"};
  if (const char* set = std::getenv("TILEGRAD_SHARED")) places.insert(places.begin(), set);
  for (const Path& place : places) {
    const auto text = ReadText(place / "vectors" / name);
    if (text.ok()) return Json::parse(*text);
  }
  return std::nullopt;
}

// Declares `json`, or ends the test.
#define TILEGRAD_VECTORS_OR_SKIP(json, name)                          \
  const auto loaded = SharedVectors(name);                            \
  if (!loaded) GTEST_SKIP() << "vectors/" << name << " is not there"; \
  const Json& json = *loaded

// Numbers of nested lists, in order.
inline void Flatten(const Json& from, std::vector<double>* to) {
  if (!from.is_array()) return to->push_back(from.get<double>());
  for (const Json& part : from) Flatten(part, to);
}
template <class T = double>
std::vector<T> Numbers(const Json& from) {
  std::vector<double> all;
  Flatten(from, &all);
  return {all.begin(), all.end()};
}

}  // namespace tilegrad
