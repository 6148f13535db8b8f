// SPDX-License-Identifier: Apache-2.0
// Threads for functions without an object that could own them.
#pragma once

#include "base/parallel.h"

namespace tilegrad::python {

// The process's Workers of `threads` threads (0: one for each core that it may use), made at the
// first call; several threads may use them at the same time. A child of a fork has Workers of its
// own.
const Workers& SharedWorkers(int threads);

}  // namespace tilegrad::python
