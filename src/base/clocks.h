// SPDX-License-Identifier: Apache-2.0
// Clocks for measuring work as it runs.
#pragma once

#include <chrono>
#include <ctime>

namespace tilegrad {

inline double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// Times the successive stages of a task.
class StageClock {
 public:
  // Adds the milliseconds since the last call, or since construction, to *stage.
  void Lap(double* stage) {
    const auto now = std::chrono::steady_clock::now();
    *stage += std::chrono::duration<double, std::milli>(now - last_).count();
    last_ = now;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

// CPU time in seconds, as the system accounts it.
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
