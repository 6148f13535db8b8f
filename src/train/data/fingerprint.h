// SPDX-License-Identifier: Apache-2.0
// Fingerprints of training data, 16 hexadecimal digits, which ranks compare before they train
// together, and runs before they resume. Errors name the file.
#pragma once

#include <string>

#include "base/file.h"
#include "base/parallel.h"
#include "train/data/photographs/photographs.h"

namespace tilegrad::train {

// Covers the index and every model file of a dataset or, if the folder holds photographs, every
// picture and its annotations.
Result<std::string> DataFingerprint(const Path& folder, const Workers& workers);
// Covers one picture and its annotations.
Result<std::string> PhotographFingerprint(const Photograph& photo);
// Combines `fingerprint` with that of one file.
Result<std::string> WithFile(const std::string& fingerprint, const Path& file);

}  // namespace tilegrad::train
