// SPDX-License-Identifier: Apache-2.0
// Counter-based random numbers: the n-th number of a stream is a pure function of (seed, stream,
// n), the same on every machine and for any thread count, and the whole state a checkpoint must
// hold is three integers.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace tilegrad {

// The finaliser of splitmix64 (Steele, Lea, Flood: Fast splittable pseudorandom number generators,
// OOPSLA 2014).
constexpr std::uint64_t Mix64(std::uint64_t z) {
  z += 0x9E3779B97F4A7C15ull;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
  return z ^ (z >> 31);
}

__extension__ using Uint128 = unsigned __int128;  // a GCC and Clang extension, used in Below only

class Rng {
 public:
  explicit Rng(std::uint64_t seed, std::uint64_t stream = 0) : key_(Mix64(seed ^ Mix64(stream))) {}

  std::uint64_t Next() { return Mix64(key_ + 0xD1342543DE82EF95ull * counter_++); }
  double Uniform() { return static_cast<double>(Next() >> 11) * 0x1.0p-53; }  // [0, 1)
  double Uniform(double low, double high) { return low + (high - low) * Uniform(); }
  // [0, n), unbiased to 2^-64 n (Lemire's multiply-shift). n > 0.
  std::uint64_t Below(std::uint64_t n) {
    return static_cast<std::uint64_t>((static_cast<Uint128>(Next()) * n) >> 64);
  }
  // Standard normal by Box-Muller; two uniforms per number, so that the position in the stream
  // stays predictable.
  double Normal() {
    const double u = 1.0 - Uniform();
    return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * std::numbers::pi * Uniform());
  }

 private:
  std::uint64_t key_;
  std::uint64_t counter_ = 0;
};

}  // namespace tilegrad
