// SPDX-License-Identifier: Apache-2.0
// Where models come from: a list made at once, and each model loaded when its turn comes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/file.h"
#include "train/data/dataset.h"

namespace tilegrad::train {

struct SourceEntry {
  std::string class_name;  // safe as a file name
  std::string id;          // unique in its class, safe as a file name
  std::string name, license, creator;
  std::string file;            // for reports
  std::optional<Split> split;  // where the source fixes it
};

// A mesh still to be normalised and rendered (y up, front towards +z), or finished data where the
// source holds images instead.
using SourceModel = std::variant<Mesh, ModelData>;

class ModelSource {
 public:
  virtual ~ModelSource() = default;
  virtual std::string name() const = 0;                      // DatasetInfo::source
  virtual std::vector<std::string> credits() const = 0;      // DatasetInfo::credits
  virtual const std::vector<SourceEntry>& entries() const = 0;  // sorted by class, then id
  // Thread-safe. Entries are asked for in ascending order, give or take the number of workers.
  virtual Result<SourceModel> Load(std::size_t entry) const = 0;
  // The camera and sizes that the source dictates, where it holds images.
  virtual std::optional<DatasetInfo> FixedInfo() const { return std::nullopt; }
};

// Parametric furniture, lamps, cars and planes (procedural.h), `per_class` of each.
std::unique_ptr<ModelSource> ProceduralSource(int per_class, std::uint64_t seed);

// Turns any text into a file name: letters, digits, '.', '-' and '_' stay, the rest becomes '_'.
std::string SafeFileName(const std::string& text);

// Sorts by class, then id, and makes ids unique in their class by appending "-2", "-3", ...
void SortEntries(std::vector<SourceEntry>* entries);

}  // namespace tilegrad::train
