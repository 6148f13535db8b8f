// SPDX-License-Identifier: Apache-2.0
// Sources that are installed packages, by the names that datasets record.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "train/data/sources/model_source.h"

namespace tilegrad::train {

struct InstalledSource {
  std::string_view name;
  const char* folder;  // where packages put it
  Result<std::unique_ptr<ModelSource>> (*open)(const Path& folder);
};

// sweethome3d, planes, ships, cars.
std::span<const InstalledSource> InstalledSources();
const InstalledSource* FindInstalledSource(std::string_view name);  // or null

inline constexpr const char* kThirteen = "thirteen";  // all of them as one

// One of them, "thirteen", or several with '+' between their names, each once, as one source of
// that name. Errors: another name, and those of opening.
Result<std::unique_ptr<ModelSource>> OpenInstalledSources(const std::string& name);

}  // namespace tilegrad::train
