// SPDX-License-Identifier: Apache-2.0
// Reads and writes NumPy's .npy and .npz: typed arrays.
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
  // A copy as T; if the array has another type, an error that describes it (bool reads as uint8).
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
  if (type != NpyTypeOf<T>() && !bool_as_bytes)
    return DataLoss("expected {}, got {}", NpyTypeName(NpyTypeOf<T>()), NpyTypeName(type));
  const auto* begin = reinterpret_cast<const T*>(data.data());
  return std::vector<T>(begin, begin + data.size() / sizeof(T));
}

// Versions 1 to 3 of the format; converts Fortran order to C order, and float16 to float32. Checks
// sizes against the data before allocating; refuses big-endian and object arrays. Messages call the
// file `name`.
Result<NpyArray> DecodeNpy(std::span<const std::uint8_t> bytes, const std::string& name);
Bytes EncodeNpy(const NpyArray& array);
Result<NpyArray> LoadNpy(const Path& path);

// float32 or float64 numbers; for other types an error that names `name`.
Result<std::vector<double>> NumbersOf(const NpyArray& array, const std::string& name);

using NpzArrays = std::map<std::string, NpyArray>;
Result<NpzArrays> LoadNpz(const Path& path);
// One array; if there is no `name`, an error that lists the arrays.
Result<NpyArray> LoadNpzArray(const Path& path, const std::string& name);
// The same for a file in memory; messages call it `place`.
Result<NpyArray> DecodeNpzArray(const Bytes& npz, const std::string& place,
                                const std::string& name);
// Compressed, atomic; the same arrays give the same bytes. At least one array.
Status SaveNpz(const Path& path, const NpzArrays& arrays);

}  // namespace tilegrad::io
