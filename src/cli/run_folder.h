// SPDX-License-Identifier: Apache-2.0
// What commands that work on a run share: which run, and which dataset it was trained on.
#pragma once

#include <string>

#include "base/file.h"

namespace tilegrad::cli {

// `given`, or if that is empty the folder below runs/ that was changed last; an error if there is
// none.
Result<Path> ChooseRun(const std::string& given);
// `given`, or if that is empty the dataset that the run's run.json names.
Result<Path> ChooseDataset(const std::string& given, const Path& run);

}  // namespace tilegrad::cli
