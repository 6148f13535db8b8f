// SPDX-License-Identifier: Apache-2.0
// The path of the running binary.
#pragma once

#include "base/file.h"

namespace tilegrad {

// The file that this code was loaded from: the program, or the shared library or Python module that
// contains it. Absolute if the loader knows; empty if the system does not say.
Path OwnBinary();

}  // namespace tilegrad
