// SPDX-License-Identifier: Apache-2.0
#include "nn/context.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace tilegrad::nn {
namespace {

constexpr std::size_t kGrain = 65536;         // numbers to a task
constexpr std::size_t kCopiedBytes = 524288;  // to a task

template <class From>
Tensor Converted(Tensor tensor, std::span<const From> values, const Workers& workers) {
  assert(values.size() == tensor.elements());
  WithFloatType(tensor.dtype(), [&]<class T>(T) {
    T* const to = tensor.data<T>();
    ForChunks(&workers, values.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      std::copy(values.begin() + static_cast<std::ptrdiff_t>(begin),
                values.begin() + static_cast<std::ptrdiff_t>(end), to + begin);  // or moves bytes
    });
  });
  return tensor;
}

}  // namespace

Context::Context(const Workers& workers, DType dtype)
    : workers_(workers), dtype_(dtype), pool_(MemoryPool::Make()), step_memory_(MakeStepMemory()) {
  assert(dtype == DType::kF32 || dtype == DType::kF64);
}

Tensor Context::Empty(const Shape& shape, DType dtype) const {
  return {pool_->Allocate(static_cast<std::size_t>(shape.elements()) * BytesOf(dtype)), shape,
          dtype};
}

Tensor Context::Full(const Shape& shape, double value) const {
  Tensor tensor = Empty(shape);
  WithFloatType(dtype_, [&]<class T>(T) {
    std::fill_n(tensor.data<T>(), tensor.elements(), static_cast<T>(value));
  });
  return tensor;
}

Tensor Context::From(const Shape& shape, std::span<const float> values) const {
  return Converted(Empty(shape), values, workers_);
}

Tensor Context::From(const Shape& shape, std::span<const double> values) const {
  return Converted(Empty(shape), values, workers_);
}

Tensor Context::Indices(std::span<const std::int32_t> values) const {
  Tensor tensor = Empty({static_cast<std::int64_t>(values.size())}, DType::kI32);
  std::copy(values.begin(), values.end(), tensor.data<std::int32_t>());
  return tensor;
}

Tensor Context::Copy(const Tensor& tensor) const {
  Tensor copy = Empty(tensor.shape(), tensor.dtype());
  ForChunks(&workers_, tensor.bytes(), kCopiedBytes, [&](std::size_t begin, std::size_t end) {
    std::memcpy(copy.raw() + begin, tensor.raw() + begin, end - begin);
  });
  return copy;
}

void Context::Fail(Status status) {
  if (status_.ok()) status_ = std::move(status);
}

Status Context::TakeStatus() { return std::exchange(status_, Status()); }

}  // namespace tilegrad::nn
