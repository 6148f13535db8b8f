// SPDX-License-Identifier: Apache-2.0
// Lets one scalar template serve float, double and std::complex<double>: every decision is taken on
// the real part, so a complex step follows the branch of its base point.
#pragma once

#include <complex>

namespace tilegrad {

template <class T>
T RealPart(T x) {
  return x;
}
template <class T>
T RealPart(const std::complex<T>& x) {
  return x.real();
}

}  // namespace tilegrad

// Compiles a function template, defined above in the same .cc, for float and for double.
#define TILEGRAD_INSTANTIATE(Function)                \
  template decltype(Function<float>) Function<float>; \
  template decltype(Function<double>) Function<double>
