// SPDX-License-Identifier: Apache-2.0
// Shared by the tests of the convolutions.
#pragma once

#include <string>

#include "nn/kernels/kernel_test_util.h"
#include "nn/kernels/kernel_trial.h"

namespace tilegrad::nn {

inline std::string Describe(const Conv2dShape& s) {
  const auto pair = [](std::size_t a, std::size_t b) {
    return std::to_string(a) + "x" + std::to_string(b);
  };
  return "batch " + std::to_string(s.batch) + ", channels " + pair(s.in_channels, s.out_channels) +
         ", image " + pair(s.in_height, s.in_width) + ", kernel " +
         pair(s.kernel_height, s.kernel_width) + ", stride " + std::to_string(s.stride) +
         ", padding " + std::to_string(s.padding);
}

}  // namespace tilegrad::nn
