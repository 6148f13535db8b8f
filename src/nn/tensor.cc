// SPDX-License-Identifier: Apache-2.0
#include "nn/tensor.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cstring>
#include <unordered_map>

#include "base/error.h"

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

namespace {

bool IsFloat(const Tensor& t) { return t.dtype() == DType::kF32 || t.dtype() == DType::kF64; }

void CopyValues(const Tensor& from, Tensor& to) {
  if (from.dtype() == to.dtype()) {
    std::memcpy(to.raw(), from.raw(), to.bytes());
    return;
  }
  WithFloatType(from.dtype(), [&]<class From>(From) {
    WithFloatType(to.dtype(), [&]<class To>(To) {
      std::transform(from.data<From>(), from.data<From>() + from.elements(), to.data<To>(),
                     [](From v) { return static_cast<To>(v); });
    });
  });
}

Status CheckFits(const NamedTensor& to, const Tensor* from) {
  if (from == nullptr) return NotFound("no tensor \"{}\"", to.name);
  if (!(from->shape() == to.value.shape()))
    return InvalidArgument("tensor \"{}\" has shape {}, {} is needed", to.name, from->shape(),
                           to.value.shape());
  if (from->dtype() == to.value.dtype() || (IsFloat(*from) && IsFloat(to.value))) return {};
  return InvalidArgument("tensor \"{}\" is {}, {} is needed", to.name, NameOf(from->dtype()),
                         NameOf(to.value.dtype()));
}

}  // namespace

const Tensor* Find(const std::vector<NamedTensor>& tensors, const std::string& name) {
  const auto it = std::find_if(tensors.begin(), tensors.end(),
                               [&](const NamedTensor& t) { return t.name == name; });
  return it == tensors.end() ? nullptr : &it->value;
}

Status CopyByName(const std::vector<NamedTensor>& from, std::vector<NamedTensor> to) {
  std::unordered_map<std::string, const Tensor*> by_name;
  for (const NamedTensor& t : from) by_name.emplace(t.name, &t.value);
  const auto source = [&](const NamedTensor& t) {
    const auto it = by_name.find(t.name);
    return it == by_name.end() ? nullptr : it->second;
  };
  for (const NamedTensor& t : to) TILEGRAD_TRY(CheckFits(t, source(t)));
  for (NamedTensor& t : to) CopyValues(*source(t), t.value);
  return {};
}

}  // namespace tilegrad::nn
