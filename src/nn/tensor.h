// SPDX-License-Identifier: Apache-2.0
// Tensors: contiguous, row-major, of rank 0 to 5. Copying a Tensor shares its storage.
#pragma once

#include <fmt/format.h>

#include <array>
#include <cassert>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "nn/memory.h"
#include "tilegrad/status.h"

namespace tilegrad::nn {

// Operations compute in kF32 (SIMD) and kF64 (the scalar references); kI32 holds indices, the
// others are only for files.
enum class DType : std::uint8_t { kF32, kF64, kU8, kI32, kI64 };

std::size_t BytesOf(DType dtype);
const char* NameOf(DType dtype);  // safetensors name: "F32", ...

template <class T>
inline constexpr DType kDTypeOf = DType::kU8;
template <>
inline constexpr DType kDTypeOf<float> = DType::kF32;
template <>
inline constexpr DType kDTypeOf<double> = DType::kF64;
template <>
inline constexpr DType kDTypeOf<std::int32_t> = DType::kI32;
template <>
inline constexpr DType kDTypeOf<std::int64_t> = DType::kI64;

// Extents, outermost first. Rank 0 is a scalar: one element.
class Shape {
 public:
  static constexpr int kMaxRank = 5;
  // More than any memory holds, and small enough that no sum of sizes in bytes overflows.
  static constexpr std::int64_t kMostElements = std::int64_t{1} << 40;

  Shape() = default;
  Shape(std::initializer_list<std::int64_t> extents) {  // NOLINT: {2, 3} is a shape
    for (std::int64_t e : extents) Append(e);
  }

  int rank() const { return rank_; }
  std::int64_t operator[](int axis) const { return extents_[static_cast<std::size_t>(axis)]; }
  std::int64_t& operator[](int axis) { return extents_[static_cast<std::size_t>(axis)]; }
  // The same shape with another extent of one axis.
  Shape With(int axis, std::int64_t extent) const {
    Shape other = *this;
    other[axis] = extent;
    return other;
  }
  void Append(std::int64_t extent) {
    assert(rank_ < kMaxRank);
    extents_[static_cast<std::size_t>(rank_++)] = extent;
  }
  std::int64_t elements() const;
  // Whether a tensor can have this shape: no extent is negative, and their product, zeros skipped,
  // is at most kMostElements.
  bool IsPossible() const;
  // Product of the extents of axes [begin, end).
  std::int64_t Product(int begin, int end) const;
  std::string ToString() const;  // "[64, 3, 32, 32]"
  bool operator==(const Shape& other) const;

 private:
  std::array<std::int64_t, kMaxRank> extents_{};
  int rank_ = 0;
};

class Tensor {
 public:
  Tensor() = default;  // holds nothing
  Tensor(BlockRef block, const Shape& shape, DType dtype)
      : block_(std::move(block)), shape_(shape), dtype_(dtype) {}

  bool empty() const { return !block_; }  // no storage; a [0, 3] tensor has storage
  const Shape& shape() const { return shape_; }
  DType dtype() const { return dtype_; }
  std::size_t elements() const { return static_cast<std::size_t>(shape_.elements()); }
  std::size_t bytes() const { return elements() * BytesOf(dtype_); }
  bool unique() const { return block_.unique(); }  // the storage has no other owner

  template <class T>
  T* data() {
    assert(dtype_ == kDTypeOf<T>);
    return reinterpret_cast<T*>(block_.data());
  }
  template <class T>
  const T* data() const {
    assert(dtype_ == kDTypeOf<T>);
    return reinterpret_cast<const T*>(block_.data());
  }
  template <class T>
  std::span<T> span() {
    return {data<T>(), elements()};
  }
  template <class T>
  std::span<const T> span() const {
    return {data<T>(), elements()};
  }
  std::byte* raw() { return block_.data(); }
  const std::byte* raw() const { return block_.data(); }

  // The same storage with another shape of as many elements.
  Tensor Reshaped(const Shape& shape) const {
    assert(shape.elements() == shape_.elements());
    return {block_, shape, dtype_};
  }

 private:
  BlockRef block_;
  Shape shape_;
  DType dtype_ = DType::kF32;
};

// Calls f(T{}) with T = float or double according to the dtype, which must be one of the two.
template <class F>
decltype(auto) WithFloatType(DType dtype, F&& f) {
  assert(dtype == DType::kF32 || dtype == DType::kF64);
  return dtype == DType::kF64 ? f(double{}) : f(float{});
}

// Named tensors, as in checkpoints.

struct NamedTensor {
  std::string name;  // "encoder.conv1.weight"
  Tensor value;      // shares the storage of the parameter or buffer
};

// The tensor of that name, or null.
const Tensor* Find(const std::vector<NamedTensor>& tensors, const std::string& name);

// Copies the tensors of `from` into those of `to` by name, converting between F32 and F64 (other
// dtypes must be equal). Every name of `to` must exist in `from` with the same shape; else changes
// nothing and returns an error that names the first that does not. Ignores other names in `from`.
Status CopyByName(const std::vector<NamedTensor>& from, std::vector<NamedTensor> to);

}  // namespace tilegrad::nn

// As ToString.
template <>
struct fmt::formatter<tilegrad::nn::Shape> : fmt::formatter<std::string> {
  auto format(const tilegrad::nn::Shape& shape, fmt::format_context& to) const {
    return fmt::formatter<std::string>::format(shape.ToString(), to);
  }
};
