// SPDX-License-Identifier: Apache-2.0
#include "train/named_weights.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>

#include "base/error.h"
#include "base/own_binary.h"

namespace tilegrad::train {
namespace {

constexpr const char *kWeightsPlace = "share/tilegrad/weights", *kWeightsEnding = ".safetensors";

// Empty where there is none.
Path WeightsFolder() {
  const char* const given = std::getenv(kWeightsVariable);
  if (given != nullptr && *given != '\0') return given;
  Path above = OwnBinary().parent_path();
  for (; !above.empty(); above = above.parent_path()) {
    if (IsFolder(above / kWeightsPlace)) return above / kWeightsPlace;
    if (above == above.parent_path()) break;
  }
  return {};
}

// Of a NAME that no weights have.
Status NoWeights(const std::string& name) {
  const std::vector<std::string> names = NamedWeights();
  if (!names.empty())
    return NotFound("no weights \"{}\" are installed; there are {}", name, fmt::join(names, ", "));
  const Path folder = WeightsFolder();
  const std::string place =
      folder.empty() ? std::string(kWeightsPlace) + " above the program" : folder.string();
  return NotFound(
      "no weights are installed (none in {}); name a run of tilegrad train, or set "
      "{} to a folder that has {}{}",
      place, kWeightsVariable, name, kWeightsEnding);
}

}  // namespace

std::vector<std::string> NamedWeights() {
  std::vector<std::string> names;
  std::error_code error;
  for (std::filesystem::directory_iterator at(WeightsFolder(), error), end; !error && at != end;
       at.increment(error)) {
    if (at->path().extension() == kWeightsEnding) names.push_back(at->path().stem().string());
  }
  std::ranges::sort(names);
  return names;
}

Result<Path> WeightsNamed(const std::string& name) {
  const Path folder = WeightsFolder();
  const Path file = folder / (name + kWeightsEnding);
  if (!folder.empty() && IsFile(file)) return file;
  return NoWeights(name);
}

Result<Path> FindRun(const Path& path_or_name) {
  const bool is_name = !path_or_name.has_parent_path() && !path_or_name.has_extension();
  if (!is_name || PathExists(path_or_name)) return path_or_name;
  auto weights = WeightsNamed(path_or_name.string());
  if (weights.ok()) return weights;
  return NotFound("{}: no run or file has that path, and {}", path_or_name.string(),
                  weights.status().message());
}

}  // namespace tilegrad::train
