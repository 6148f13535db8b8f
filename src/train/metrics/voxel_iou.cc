// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cassert>

#include "train/metrics/metrics.h"

namespace tilegrad::train {

double VoxelIou(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b) {
  assert(a.size() == b.size());
  std::size_t both = 0, either = 0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    both += a[i] != 0 && b[i] != 0;
    either += a[i] != 0 || b[i] != 0;
  }
  return either == 0 ? 1.0 : static_cast<double>(both) / static_cast<double>(either);
}

}  // namespace tilegrad::train
