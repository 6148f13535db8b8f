// SPDX-License-Identifier: Apache-2.0
// The environment of every NN kernel besides its operands: workers, scratch memory and options.
#pragma once

#include <cstddef>

#include "base/aligned.h"
#include "base/parallel.h"

namespace tilegrad::nn {

// Scratch memory of the kernels. Grows to the largest use and is then reused, so that repeating the
// same calls allocates nothing. Only one kernel at a time may use it.
class KernelScratch {
 public:
  // At least `count` numbers with unspecified contents, aligned to kAlignment, valid until the next
  // call.
  float* Floats(std::size_t count) { return Grown(floats_, count); }
  std::size_t* Indices(std::size_t count) { return Grown(indices_, count); }
  std::size_t bytes() const {
    return floats_.size() * sizeof(float) + indices_.size() * sizeof(std::size_t);
  }

 private:
  template <class T>
  static T* Grown(AlignedVector<T>& buffer, std::size_t count) {
    if (buffer.size() < count) {
      buffer = {};  // frees before it allocates: discards the old contents
      buffer.resize(count);
    }
    return buffer.data();
  }
  AlignedVector<float> floats_;
  AlignedVector<std::size_t> indices_;
};

struct KernelContext {
  const Workers& workers;
  KernelScratch& scratch;
  // Convolutions may use fewer multiplications with slightly more rounding: winograd.h.
  bool winograd = true;
};

}  // namespace tilegrad::nn
