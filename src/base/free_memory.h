// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace tilegrad {

// Returns free heap memory to the system, including what malloc keeps otherwise: memory freed by
// another thread than the one that allocated it, and gaps between live blocks. Takes a millisecond
// per 100 MB.
void ReturnFreeMemory();

}  // namespace tilegrad
