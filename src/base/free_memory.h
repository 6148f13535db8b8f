// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace tilegrad {

// Gives the system what the heap holds of memory that was freed, where it otherwise stays with the
// process: what one thread has allocated and another frees, and what lies between blocks in use. A
// millisecond for each 100 MB.
void ReturnFreeMemory();

}  // namespace tilegrad
