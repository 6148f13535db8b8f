// SPDX-License-Identifier: Apache-2.0
// One step of a moving average over a block of parameters. Memory bounds it and every compiler
// vectorises it, so there is one plain loop for all types.
#pragma once

#include <cstddef>

#include "base/parallel.h"

namespace tilegrad::nn {

// y = decay y + (1 - decay) x.
struct BlendShape {
  std::size_t n = 0;
  double decay = 0;
};
template <class T>
void Blend(const BlendShape& shape, const T* x, T* y, const Workers& workers);

}  // namespace tilegrad::nn
