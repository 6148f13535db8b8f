// SPDX-License-Identifier: Apache-2.0
// The environment of every computation of this library: workers, memory, number type, and error
// state. There are no globals; contexts are independent, and mixing operands of two is an error.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "base/parallel.h"
#include "nn/kernels/kernel_context.h"
#include "nn/memory.h"
#include "nn/tensor.h"
#include "tilegrad/status.h"

namespace tilegrad::nn {

// Not thread-safe: use from one thread at a time (operations themselves run on all workers).
//
// Errors: an operation with operands that do not match records the reason here and returns an
// invalid Var; operations on invalid Vars return invalid Vars. So formulas need no error handling:
// check status(), which holds the first error, once per step or before using a result.
class Context {
 public:
  // `workers` must outlive the context. `dtype` (kF32 or kF64) is the type of parameters that
  // layers create, and of tensors created without naming one.
  explicit Context(const Workers& workers, DType dtype = DType::kF32);
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  const Workers& workers() const { return workers_; }
  KernelContext kernels() { return {workers_, scratch_}; }
  DType dtype() const { return dtype_; }

  Tensor Empty(const Shape& shape, DType dtype) const;  // uninitialised
  Tensor Empty(const Shape& shape) const { return Empty(shape, dtype_); }
  Tensor Full(const Shape& shape, double value) const;  // dtype()
  Tensor Zeros(const Shape& shape) const { return Full(shape, 0.0); }
  // Copies shape.elements() numbers from `values`, converted to dtype().
  Tensor From(const Shape& shape, std::span<const float> values) const;
  Tensor From(const Shape& shape, std::span<const double> values) const;
  Tensor Indices(std::span<const std::int32_t> values) const;  // [n] of kI32
  Tensor Copy(const Tensor& tensor) const;                     // with its own storage

  MemoryPool& memory() const { return *pool_; }
  // For the small objects of a step (memory.h).
  template <class T>
  StepAllocator<T> allocator() const {
    return StepAllocator<T>(step_memory_);
  }

  const Status& status() const { return status_; }
  void Fail(Status status);  // keeps the first error
  Status TakeStatus();       // returns the error, if any, and clears it

  bool recording() const { return recording_; }
  void set_recording(bool on) { recording_ = on; }
  std::uint64_t NextOrder() { return ++order_; }  // creation order of graph nodes

 private:
  const Workers& workers_;
  DType dtype_;
  std::shared_ptr<MemoryPool> pool_;
  std::shared_ptr<std::pmr::memory_resource> step_memory_;
  KernelScratch scratch_;
  Status status_;
  bool recording_ = true;
  std::uint64_t order_ = 0;
};

// Sets whether operations record their derivatives, for a scope.
class RecordingScope {
 public:
  RecordingScope(Context& context, bool on) : context_(context), before_(context.recording()) {
    context_.set_recording(on);
  }
  ~RecordingScope() { context_.set_recording(before_); }
  RecordingScope(const RecordingScope&) = delete;
  RecordingScope& operator=(const RecordingScope&) = delete;

 private:
  Context& context_;
  bool before_;
};

// Evaluation without a backward pass: { NoGrad off(context); ... }
class NoGrad : public RecordingScope {
 public:
  explicit NoGrad(Context& context) : RecordingScope(context, false) {}
};

}  // namespace tilegrad::nn
