// SPDX-License-Identifier: Apache-2.0
// Reading a file within a budget that the caller gave.
#pragma once

#include <cstddef>
#include <optional>

#include "base/read_budget.h"
#include "bindings/to_python.h"

namespace tilegrad::python {

// What `load` returns, without the GIL. max_bytes: of ReadBudget; 0: the usual limit.
template <class Load>
auto LoadWithin(std::size_t max_bytes, const Load& load) {
  return ValueOrThrow(WithoutGil([&] {
    std::optional<ReadBudget> budget;
    if (max_bytes > 0) budget.emplace(max_bytes);
    return load();
  }));
}

}  // namespace tilegrad::python
