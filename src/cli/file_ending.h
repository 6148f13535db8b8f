// SPDX-License-Identifier: Apache-2.0
// Options that name one output file of a fixed format.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>

namespace tilegrad::cli {

// Refuses names that end otherwise: pic.jpg would be a PNG that programs take for something else.
// Names without an ending, as of devices, are fine.
inline CLI::Validator FileEnding(const std::string& ending) {
  const auto check = [ending](const std::string& name) {
    const std::string given = CLI::detail::to_lower(std::filesystem::path(name).extension());
    return given.empty() || given == ending ? std::string() : name + ": it is written as " + ending;
  };
  return {check, ""};
}

}  // namespace tilegrad::cli
