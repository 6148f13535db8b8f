// SPDX-License-Identifier: Apache-2.0
// Times the successive stages of a task.
#pragma once

#include <chrono>

namespace tilegrad {

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

}  // namespace tilegrad
