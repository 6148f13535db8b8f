// SPDX-License-Identifier: Apache-2.0
// Divides a range into parts.
#pragma once

#include <algorithm>
#include <cstddef>

#include "base/parallel.h"

namespace tilegrad::nn {

constexpr std::size_t DivideUp(std::size_t a, std::size_t b) { return (a + b - 1) / b; }
constexpr std::size_t RoundUp(std::size_t a, std::size_t b) { return DivideUp(a, b) * b; }

// More workers get smaller tasks where results do not depend on the division.
constexpr std::size_t kFewWorkers = 4;

// Elements to a task of a loop over n: `most`, or down to an eighth of it where many workers would
// not get two tasks each.
inline std::size_t GrainFor(std::size_t n, std::size_t most, const Workers& workers) {
  const auto count = workers.size();
  return count <= kFewWorkers ? most : std::clamp(n / (2 * count), DivideUp(most, 8), most);
}

// [0, total) as the fewest parts of at most `limit`, whose sizes differ by at most one: 64 rows in
// panels of at most 6 are 9 x 6 + 2 x 5, so that no panel is left nearly empty.
class Panels {
 public:
  Panels(std::size_t total, std::size_t limit) : Panels(Count{DivideUp(total, limit)}, total) {}

  // The same in `count` parts, 0 < count <= total.
  static Panels Parts(std::size_t total, std::size_t count) { return Panels(Count{count}, total); }

  std::size_t count() const { return count_; }
  std::size_t begin(std::size_t panel) const {
    return panel * small_ + std::min(panel, large_count_);
  }
  struct Range {
    std::size_t begin, end;
  };
  // [begin, end) of a panel, relative to `origin`.
  Range range(std::size_t panel, std::size_t origin = 0) const {
    return {origin + begin(panel), origin + begin(panel + 1)};
  }
  std::size_t size(std::size_t panel) const { return small_ + (panel < large_count_ ? 1 : 0); }
  std::size_t largest() const { return small_ + (large_count_ > 0 ? 1 : 0); }

 private:
  struct Count {
    std::size_t parts;
  };
  Panels(Count count, std::size_t total)
      : count_(count.parts),
        small_(count_ == 0 ? 0 : total / count_),
        large_count_(count_ == 0 ? 0 : total % count_) {}

  std::size_t count_, small_, large_count_;
};

}  // namespace tilegrad::nn
