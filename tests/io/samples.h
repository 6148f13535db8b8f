// SPDX-License-Identifier: Apache-2.0
// Files in samples/, in formats that nothing here writes.
#pragma once

#include <string>

#include "base/file.h"
#include "support/source_dir.h"

namespace tilegrad::io {

inline Bytes StoredSample(const std::string& name) {
  return ReadFile(Path(TILEGRAD_SOURCE_DIR) / "tests/io/samples" / name).value();
}

}  // namespace tilegrad::io
