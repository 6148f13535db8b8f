// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "base/file.h"
#include "base/parallel.h"

namespace tilegrad::train {

// 16 hexadecimal digits over the index and every model file of a dataset. Errors name the file.
Result<std::string> DatasetFingerprint(const Path& folder, const Workers& workers);

}  // namespace tilegrad::train
