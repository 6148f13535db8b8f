// SPDX-License-Identifier: Apache-2.0
// What a run learns from, as 16 hexadecimal digits: ranks that are to work together compare them.
// Errors name the file.
#pragma once

#include <string>

#include "base/file.h"
#include "base/parallel.h"

namespace tilegrad::train {

// Of the index and every model file of a dataset or, if the folder holds photographs, of every
// picture and of what is known of it.
Result<std::string> DataFingerprint(const Path& folder, const Workers& workers);
// Of one file, and of a fingerprint that it belongs to.
Result<std::string> WithFile(const std::string& fingerprint, const Path& file);

}  // namespace tilegrad::train
