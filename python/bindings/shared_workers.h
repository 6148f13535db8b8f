// SPDX-License-Identifier: Apache-2.0
// Threads for functions without an object that could own them.
#pragma once

#include "base/parallel.h"

namespace tilegrad::python {

// The process's Workers of `threads` threads (0: one for each core that it may use), made at the
// first call; several threads may use them at the same time. In a child of a process that had some,
// after a fork, there is one worker, the caller: the parent's threads do not exist there.
const Workers& SharedWorkers(int threads);

}  // namespace tilegrad::python
