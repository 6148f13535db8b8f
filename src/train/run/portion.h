// SPDX-License-Identifier: Apache-2.0
// A batch is cut into portions, each computed by itself with batch-norm statistics of its own, and
// their results are summed in one binary tree: the same bits from one process or many.
#pragma once

#include <bit>
#include <cstdint>

#include "base/error.h"

namespace tilegrad::train {

struct Portion {
  std::int64_t index = 0, count = 1;
  bool operator==(const Portion&) const = default;
};

// The positions of objects in the run: step * batch + slot. All that is random about an object
// follows from its position.
struct Slots {
  std::int64_t first = 0, count = 0;
};

// Those of a portion of a step's batch, which is a multiple of portion.count.
inline Slots SlotsOf(std::int64_t step, std::int64_t batch, const Portion& portion = {}) {
  const std::int64_t count = batch / portion.count;
  return {step * batch + portion.index * count, count};
}

// InvalidArgument unless `portions` is a power of two that divides schedule.batch.
inline Status CheckPortions(std::int64_t batch, std::int64_t portions) {
  if (!std::has_single_bit(static_cast<std::uint64_t>(portions)))
    return InvalidArgument("schedule.portions is {}, but must be a power of two", portions);
  if (batch % portions == 0) return {};
  return InvalidArgument(
      "schedule.batch is {}, which schedule.portions = {} does not divide: take a multiple of {}, "
      "or schedule.portions = {}",
      batch, portions, portions, 1 << std::countr_zero(static_cast<std::uint64_t>(batch)));
}

}  // namespace tilegrad::train
