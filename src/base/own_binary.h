// SPDX-License-Identifier: Apache-2.0
// Where this code lies on disk.
#pragma once

#include "base/file.h"

namespace tilegrad {

// The file that this code was loaded from: the program, or the shared library or Python module that
// has it inside. Absolute as far as the loader knows; empty where the system does not tell.
Path OwnBinary();

}  // namespace tilegrad
