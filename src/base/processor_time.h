// SPDX-License-Identifier: Apache-2.0
// Seconds that processors have worked, as the system counts them.
#pragma once

#include <ctime>

namespace tilegrad {

namespace internal {
inline double SecondsOf(clockid_t clock) {
  timespec t{};
  ::clock_gettime(clock, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}
}  // namespace internal

inline double ThreadSeconds() { return internal::SecondsOf(CLOCK_THREAD_CPUTIME_ID); }
inline double ProcessSeconds() { return internal::SecondsOf(CLOCK_PROCESS_CPUTIME_ID); }

}  // namespace tilegrad
