// SPDX-License-Identifier: Apache-2.0
#include "train/run/portion.h"

#include <bit>

#include "base/error.h"

namespace tilegrad::train {

Status CheckPortions(std::int64_t batch, std::int64_t portions) {
  if (!std::has_single_bit(static_cast<std::uint64_t>(portions)))
    return InvalidArgument("schedule.portions is {}, but must be a power of two", portions);
  if (batch % portions == 0) return {};
  return InvalidArgument(
      "schedule.batch is {}, which schedule.portions = {} does not divide: take a multiple of {}",
      batch, portions, portions);
}

}  // namespace tilegrad::train
