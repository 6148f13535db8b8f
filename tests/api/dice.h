// SPDX-License-Identifier: Apache-2.0
// What random calls choose by: the same choices from the same seed, or from the same bytes.
#pragma once

#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <span>

namespace tilegrad {

// The multiplier and increment are Knuth's for 64 bits (MMIX); the high bits are the random ones.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : state_(seed) {}
  // Two bytes a choice; once they are used up, as by a seed that is their number.
  explicit Dice(std::span<const std::uint8_t> bytes) : state_(bytes.size()), bytes_(bytes) {}
  std::uint32_t Next() {
    if (bytes_.size() >= 2) {
      const std::uint32_t value = bytes_[0] + 256u * bytes_[1];
      bytes_ = bytes_.subspan(2);
      return value;
    }
    state_ = state_ * 6364136223846793005u + 1442695040888963407u;
    return static_cast<std::uint32_t>(state_ >> 33);
  }
  bool used_up() const { return bytes_.size() < 2; }
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
  std::span<const std::uint8_t> bytes_;
};

}  // namespace tilegrad
