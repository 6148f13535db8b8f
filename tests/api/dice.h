// SPDX-License-Identifier: Apache-2.0
// What random calls choose by: the same choices from the same seed.
#pragma once

#include <cmath>
#include <cstdint>
#include <initializer_list>

namespace tilegrad {

// The multiplier and increment are Knuth's for 64 bits (MMIX); the high bits are the random ones.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : state_(seed) {}
  std::uint32_t Next() {
    state_ = state_ * 6364136223846793005u + 1442695040888963407u;
    return static_cast<std::uint32_t>(state_ >> 33);
  }
  bool OneIn(std::uint32_t n) { return Next() % n == 0; }
  template <class T>
  T Of(std::initializer_list<T> values) {
    return values.begin()[Next() % values.size()];
  }
  float Number() {
    if (OneIn(4000)) return Of({NAN, INFINITY, -INFINITY, 3e38f, -1e30f, 1e-42f});
    return static_cast<float>(Next() % 20001) / 10000.0f - 1.0f;
  }

 private:
  std::uint64_t state_;
};

}  // namespace tilegrad
