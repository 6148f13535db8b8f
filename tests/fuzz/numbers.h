// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>

#include "base/rng.h"
#include "base/simd_target.h"
#include "fuzz/target.h"

namespace tilegrad::fuzz {

// Numbers off the front of an input; zeros after its end.
class Numbers {
 public:
  explicit Numbers(Input input) : rest_(input) {}
  template <class T>
  T Take() {
    T out{};
    const std::size_t n = std::min(sizeof(T), rest_.size());
    std::memcpy(&out, rest_.data(), n);
    rest_ = rest_.subspan(n);
    return out;
  }
  std::uint32_t Below(std::uint32_t n) { return Take<std::uint8_t>() % n; }
  bool empty() const { return rest_.empty(); }

 private:
  Input rest_;
};

// One of those that this machine has.
inline std::string TargetOf(Numbers* in) {
  const auto targets = RunnableTargets();
  return targets[in->Below(static_cast<std::uint32_t>(targets.size()))];
}

inline Bytes RandomBytes(std::uint64_t seed, std::size_t size) {
  Rng rng(seed);
  Bytes out(size);
  for (std::uint8_t& byte : out) byte = static_cast<std::uint8_t>(rng.Next());
  return out;
}

template <std::uint64_t count, std::size_t size>
std::vector<Bytes> RandomSeeds() {
  std::vector<Bytes> out;
  for (std::uint64_t seed = 1; seed <= count; ++seed) out.push_back(RandomBytes(seed, size));
  return out;
}

}  // namespace tilegrad::fuzz
