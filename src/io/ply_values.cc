// SPDX-License-Identifier: Apache-2.0
#include "io/ply_values.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "io/text_scan.h"

namespace tilegrad::io {
namespace {

template <class T>
double Decode(const char* bytes, bool swap) {
  std::array<char, sizeof(T)> copy;
  std::memcpy(copy.data(), bytes, sizeof(T));
  if (swap) std::reverse(copy.begin(), copy.end());
  return static_cast<double>(std::bit_cast<T>(copy));
}

double DecodeAs(PlyType type, const char* bytes, bool swap) {
  switch (type) {
    case PlyType::kI8:
      return Decode<std::int8_t>(bytes, swap);
    case PlyType::kU8:
      return Decode<std::uint8_t>(bytes, swap);
    case PlyType::kI16:
      return Decode<std::int16_t>(bytes, swap);
    case PlyType::kU16:
      return Decode<std::uint16_t>(bytes, swap);
    case PlyType::kI32:
      return Decode<std::int32_t>(bytes, swap);
    case PlyType::kU32:
      return Decode<std::uint32_t>(bytes, swap);
    case PlyType::kF32:
      return Decode<float>(bytes, swap);
    case PlyType::kF64:
      return Decode<double>(bytes, swap);
  }
  return 0;
}

}  // namespace

bool PlyValues::Next(PlyType type, double& value) {
  if (text_) return ParseAnyNumber(NextToken(rest_), value);
  const std::size_t size = PlyTypeSize(type);
  if (rest_.size() < size) return false;
  value = DecodeAs(type, rest_.data(), swap_);
  rest_.remove_prefix(size);
  return true;
}

bool PlyValues::NextLength(const PlyProperty& property, std::size_t& length) {
  double value = 0;
  if (!Next(*property.count_type, value)) return false;
  const std::size_t least = text_ ? 1 : PlyTypeSize(property.type);
  if (!(value >= 0 && value <= static_cast<double>(rest_.size() / least))) return false;
  length = static_cast<std::size_t>(value);
  return true;
}

bool PlyValues::NextList(const PlyProperty& property, std::vector<double>& list) {
  std::size_t length = 0;
  if (!NextLength(property, length)) return false;
  list.resize(length);
  for (double& value : list) {
    if (!Next(property.type, value) || !std::isfinite(value)) return false;
  }
  return true;
}

bool PlyValues::Skip(const PlyProperty& property) {
  std::size_t count = 1;
  if (property.count_type && !NextLength(property, count)) return false;
  if (text_) {
    while (count > 0 && !NextToken(rest_).empty()) --count;
    return count == 0;
  }
  const std::size_t bytes = count * PlyTypeSize(property.type);
  if (rest_.size() < bytes) return false;
  rest_.remove_prefix(bytes);
  return true;
}

}  // namespace tilegrad::io
