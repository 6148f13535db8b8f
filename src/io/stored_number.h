// SPDX-License-Identifier: Apache-2.0
// Internal to io: numbers as binary files store them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace tilegrad::io {

enum class StoredType { kI8, kU8, kI16, kU16, kI32, kU32, kI64, kU64, kF32, kF64 };

struct StoredTypeRow {
  std::size_t size;                // bytes
  double (*load)(const void* at);  // little-endian, anywhere in memory
};

template <class T>
double LoadStored(const void* at) {
  T value;
  std::memcpy(&value, at, sizeof(T));
  return static_cast<double>(value);
}
template <class... T>
constexpr std::array<StoredTypeRow, sizeof...(T)> StoredRowsOf() {
  return {{{sizeof(T), &LoadStored<T>}...}};
}

inline const StoredTypeRow& RowOf(StoredType type) {
  static constexpr auto kRows =
      StoredRowsOf<std::int8_t, std::uint8_t, std::int16_t, std::uint16_t, std::int32_t,
                   std::uint32_t, std::int64_t, std::uint64_t, float, double>();
  return kRows[static_cast<std::size_t>(type)];
}

}  // namespace tilegrad::io
