// SPDX-License-Identifier: Apache-2.0
// Internal to io: the header of a PLY file.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tilegrad/status.h"

namespace tilegrad::io {

// Internal to io: number types of binary files.

enum class StoredType { kI8, kU8, kI16, kU16, kI32, kU32, kI64, kU64, kF32, kF64 };

struct StoredTypeRow {
  std::size_t size;                // bytes
  double (*load)(const void* at);  // little-endian, unaligned
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

struct PlyProperty {
  std::string name;
  StoredType type;
  std::optional<StoredType> count_type;  // set for a list: the type of its length
};

struct PlyElement {
  std::string name;
  std::size_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  enum class Encoding { kText, kLittleEndian, kBigEndian } encoding = Encoding::kText;
  std::vector<PlyElement> elements;
  std::vector<std::string> textures;  // of each "comment TextureFile NAME"
  std::string_view data;              // after the header

  // The number of rows of an element, 0 if there is no such element.
  std::size_t CountOf(std::string_view element) const;
};

// Errors name `place` and the line; among them elements with more rows than the data could hold.
Result<PlyHeader> ParsePlyHeader(std::string_view file, const std::string& place);

}  // namespace tilegrad::io
