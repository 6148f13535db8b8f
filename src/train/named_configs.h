// SPDX-License-Identifier: Apache-2.0
// The configurations of configs/, compiled in: a program that was installed, or moved, knows them.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "train/config.h"

namespace tilegrad::train {

struct NamedConfig {
  std::string_view name, text;  // "quick", and the file that has it
};
// Sorted by name.
std::span<const NamedConfig> NamedConfigs();
// NotFound lists the names.
Result<NamedConfig> ConfigNamed(std::string_view name);

// The file of that path; if there is none, the configuration of that name. So "quick" is found
// wherever the program runs, and a file "quick" in the current folder goes before it. Errors as of
// ReadConfig; NotFound lists the names.
Result<TrainConfig> FindConfig(const std::string& path_or_name);

}  // namespace tilegrad::train
