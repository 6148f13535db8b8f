// SPDX-License-Identifier: Apache-2.0
// Asking for memory before it is used.
#pragma once

#include <hwy/base.h>

#include <cstddef>

namespace tilegrad {

inline constexpr std::size_t kLineFloats = 16;  // in a cache line

// Asks for the cache line of `data`. The empty statement keeps the request: GCC 12 takes a function
// that does nothing but prefetch for one without effect and drops the call.
HWY_INLINE void PrefetchLine(const void* data) {
  __builtin_prefetch(data);
  asm volatile("");
}

// Asks for `count` numbers of four bytes, a line at a time.
template <class T>
HWY_INLINE void PrefetchNumbers(const T* data, std::size_t count) {
  static_assert(sizeof(T) == sizeof(float));
  for (std::size_t i = 0; i < count; i += kLineFloats) PrefetchLine(data + i);
}

// Asks for a line to write it: other cores let go of it at once, not when the write comes. Without
// the compiler's leave to use the instruction, which every x86-64 knows or ignores, GCC asks to
// read.
HWY_INLINE void PrefetchLineToWrite(float* data) {
#if HWY_ARCH_X86_64 && HWY_COMPILER_GCC
  asm volatile("prefetchw %0" : : "m"(*data));
#else
  __builtin_prefetch(data, 1);
#endif
}

// Asks for a line, past the nearest cache: for what is used some thousand cycles later.
HWY_INLINE void PrefetchLineToL2(const void* data) {
  __builtin_prefetch(data, 0, 2);
  asm volatile("");
}

}  // namespace tilegrad
