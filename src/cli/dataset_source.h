// SPDX-License-Identifier: Apache-2.0
// The values of `tilegrad dataset --source`.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "train/data/sources/model_source.h"

namespace tilegrad::cli {

struct DatasetSourceRequest {
  std::vector<std::string> sources;  // names of DatasetSourceNames
  std::string input, split_list;     // empty: not given
  int procedural_per_class = 0;      // 0: the default
  std::uint64_t seed = 0;            // of procedural shapes
};

std::vector<std::string> DatasetSourceNames();
// One sentence on each.
std::string DatasetSourceHelp();

// One source, or several of installed packages as one. Errors: --input is missing, or given where
// there is no one folder to read; a name twice; several of which one is no package; and those of
// opening them.
Result<std::unique_ptr<train::ModelSource>> OpenDatasetSource(const DatasetSourceRequest& request);

}  // namespace tilegrad::cli
