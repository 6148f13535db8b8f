// SPDX-License-Identifier: Apache-2.0
// NumPy's .npy and .npz: typed arrays in and out.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/file.h"

namespace tilegrad::io {

enum class NpyType { kBool, kU8, kI8, kU16, kI16, kU32, kI32, kU64, kI64, kF32, kF64 };

std::size_t NpyTypeSize(NpyType type);  // bytes
const char* NpyTypeName(NpyType type);  // "float32", ...

template <class T>
constexpr NpyType NpyTypeOf() {
  if constexpr (std::is_same_v<T, std::uint8_t>) return NpyType::kU8;
  if constexpr (std::is_same_v<T, std::int32_t>) return NpyType::kI32;
  if constexpr (std::is_same_v<T, std::int64_t>) return NpyType::kI64;
  if constexpr (std::is_same_v<T, float>) return NpyType::kF32;
  if constexpr (std::is_same_v<T, double>) return NpyType::kF64;
}

// A dense array in C order.
struct NpyArray {
  NpyType type = NpyType::kU8;
  std::vector<std::size_t> shape;
  Bytes data;  // little-endian; size = product of shape * NpyTypeSize(type)

  std::size_t count() const { return data.size() / NpyTypeSize(type); }
  // A copy as T; an error that says what the array is if it has another type (bool reads as uint8).
  template <class T>
  Result<std::vector<T>> As() const;
};

template <class T>
NpyArray MakeNpy(std::vector<std::size_t> shape, std::span<const T> values) {
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(values.data());
  return {NpyTypeOf<T>(), std::move(shape), Bytes(bytes, bytes + values.size_bytes())};
}

template <class T>
Result<std::vector<T>> NpyArray::As() const {
  const bool bool_as_bytes = type == NpyType::kBool && NpyTypeOf<T>() == NpyType::kU8;
  if (type != NpyTypeOf<T>() && !bool_as_bytes) {
    return DataLoss("expected {}, got {}", NpyTypeName(NpyTypeOf<T>()), NpyTypeName(type));
  }
  const auto* begin = reinterpret_cast<const T*>(data.data());
  return std::vector<T>(begin, begin + data.size() / sizeof(T));
}

// Versions 1 to 3 of the format; Fortran order is converted, and float16 becomes float32. Sizes are
// checked against the data before memory is taken; big-endian and object arrays are refused. `name`
// stands in messages.
Result<NpyArray> DecodeNpy(std::span<const std::uint8_t> bytes, const std::string& name);
Bytes EncodeNpy(const NpyArray& array);
Result<NpyArray> LoadNpy(const Path& path);

// Of float32 or float64; `name` stands in the error for other types.
Result<std::vector<double>> NumbersOf(const NpyArray& array, const std::string& name);

using NpzArrays = std::map<std::string, NpyArray>;
Result<NpzArrays> LoadNpz(const Path& path);
// One array; an error that lists what is there if `name` is not.
Result<NpyArray> LoadNpzArray(const Path& path, const std::string& name);
// The same of a file in memory; `place` stands for it in messages.
Result<NpyArray> DecodeNpzArray(const Bytes& npz, const std::string& place,
                                const std::string& name);
// Compressed, whole or not at all; the same arrays give the same bytes. One array at least.
Status SaveNpz(const Path& path, const NpzArrays& arrays);

}  // namespace tilegrad::io
