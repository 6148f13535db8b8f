// SPDX-License-Identifier: Apache-2.0
// A checksum of bytes, the same on every machine of one byte order. Not cryptographic. Takes eight
// bytes at a time, since checkpoints have hundreds of megabytes. HashText (train/data/split.h) must
// stay as it is: its values determine the split of every dataset.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "base/rng.h"

namespace tilegrad {

class Hash {
 public:
  // Two calls give a different hash than one call with the concatenation.
  void Add(std::string_view bytes) {
    state_ = Mix64(state_ ^ bytes.size());
    while (!bytes.empty()) {
      std::uint64_t word = 0;
      const std::size_t count = std::min(bytes.size(), sizeof(word));
      std::memcpy(&word, bytes.data(), count);
      state_ = Mix64(state_ ^ word);
      bytes.remove_prefix(count);
    }
  }
  // A vector of numbers, or of structs of numbers without padding.
  template <class Vector>
  void AddAll(const Vector& values) {
    AddBytes(values.data(), values.size() * sizeof(values[0]));
  }
  void AddBytes(const void* data, std::size_t size) {
    Add(std::string_view(static_cast<const char*>(data), size));
  }
  std::string Text() const { return fmt::format("{:016x}", state_); }  // 16 hexadecimal digits

 private:
  std::uint64_t state_ = 0;
};

}  // namespace tilegrad
