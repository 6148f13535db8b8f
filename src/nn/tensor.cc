// SPDX-License-Identifier: Apache-2.0
#include "nn/tensor.h"

#include <fmt/ranges.h>

#include <algorithm>

namespace tilegrad::nn {

std::size_t BytesOf(DType dtype) {
  static constexpr std::size_t kBytes[] = {4, 8, 1, 4, 8};
  return kBytes[static_cast<std::size_t>(dtype)];
}

const char* NameOf(DType dtype) {
  static constexpr const char* kNames[] = {"F32", "F64", "U8", "I32", "I64"};
  return kNames[static_cast<std::size_t>(dtype)];
}

std::int64_t Shape::elements() const { return Product(0, rank_); }

bool Shape::IsPossible() const {
  std::int64_t product = 1;
  for (int axis = 0; axis < rank_; ++axis) {
    const std::int64_t extent = (*this)[axis];
    if (extent < 0 || extent > kMostElements / product) return false;
    product *= std::max<std::int64_t>(extent, 1);
  }
  return true;
}

std::int64_t Shape::Product(int begin, int end) const {
  std::int64_t n = 1;
  for (int axis = begin; axis < end; ++axis) n *= (*this)[axis];
  return n;
}

std::string Shape::ToString() const {
  return fmt::format("[{}]", fmt::join(extents_.begin(), extents_.begin() + rank_, ", "));
}

bool Shape::operator==(const Shape& other) const {
  return rank_ == other.rank_ &&
         std::equal(extents_.begin(), extents_.begin() + rank_, other.extents_.begin());
}

}  // namespace tilegrad::nn
