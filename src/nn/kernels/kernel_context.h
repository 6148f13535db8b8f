// SPDX-License-Identifier: Apache-2.0
// What every NN kernel is handed besides its operands: the workers it may use and memory it may
// scribble on.
#pragma once

#include <cstddef>

#include "base/aligned.h"
#include "base/parallel.h"

namespace tilegrad::nn {

// Scratch memory of the kernels. It grows to the largest use and is then reused, so that repeating
// the same calls allocates nothing. One kernel at a time may use it.
class KernelScratch {
 public:
  // At least `count` floats with unspecified contents, aligned to kAlignment, until the next call.
  float* Take(std::size_t count) {
    if (buffer_.size() < count) {
      buffer_ = {};  // frees before it allocates: the old contents are not kept
      buffer_.resize(count);
    }
    return buffer_.data();
  }
  std::size_t bytes() const { return buffer_.size() * sizeof(float); }

 private:
  AlignedVector<float> buffer_;
};

struct KernelContext {
  const Workers& workers;
  KernelScratch& scratch;
};

}  // namespace tilegrad::nn
