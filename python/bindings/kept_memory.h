// SPDX-License-Identifier: Apache-2.0
// Memory for results that a program asks for again and again, as the steps of a training do: blocks
// that arrays gave back are handed out again. Pages that come anew from the system may cost more
// than what is computed into them.
#pragma once

#include <cstddef>

#include "bindings/arrays.h"

namespace tilegrad::python {

inline constexpr std::size_t kLeastKeptBytes = std::size_t{1} << 16;  // malloc keeps smaller ones
// In all; beyond, those that were given back first go to the system.
inline constexpr std::size_t kMostKeptBytes = std::size_t{256} << 20;

// At least `bytes` uninitialised bytes, aligned for kernels, until the capsule dies. With the GIL
// held, which is also held when the capsule dies.
struct KeptBlock {
  void* data;
  py::capsule owner;
};
KeptBlock TakeKeptBlock(std::size_t bytes);

}  // namespace tilegrad::python
