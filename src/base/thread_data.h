// SPDX-License-Identifier: Apache-2.0
// What a thread needs before it can say that memory is out.
#pragma once

namespace tilegrad {

// For a thread that has just started. Of libraries that are loaded at run time, as Python loads
// ours, glibc allocates a thread's own variables at their first use, and ends the process where it
// cannot. Those of C++'s runtime are first used by the thread's first exception: mostly
// std::bad_alloc.
void ReserveThreadData();

}  // namespace tilegrad
