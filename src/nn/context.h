// SPDX-License-Identifier: Apache-2.0
// The environment of every computation of this library: workers, memory, number type, and error
// state. There are no globals; contexts are independent, and mixing operands of two is an error.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "base/worker_groups.h"
#include "nn/kernels/kernel_context.h"
#include "nn/memory.h"
#include "nn/tensor.h"
#include "tilegrad/status.h"

namespace tilegrad::nn {

// Used by one thread at a time (operations themselves run on all workers), except for its lanes: in
// these, several threads compute side by side with the same parameters, each on a group of the
// workers and with its own memory, errors and recording. Var and Tensor need not know: the context
// answers a thread for the thread's lane.
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

  const Workers& workers() const { return *here().workers; }
  KernelContext kernels() { return {workers(), here().scratch}; }
  DType dtype() const { return dtype_; }

  // Divides the workers into min(most, workers().count()) groups with a lane each; a single group
  // makes no lanes. Call once, before constructing any PerLane.
  void MakeLanes(std::size_t most);
  // The number of groups; 1 without lanes.
  std::size_t lanes() const { return groups_ ? groups_->count() : 1; }
  // Calls task(i) for i in [0, lanes()), concurrently, each in its lane; without lanes calls
  // task(0) outside. Tensors may outlive their lane's task, graphs and StepVectors must not.
  void ForEachLane(FunctionRef<void(std::size_t i)> task, LoopSite site = LoopSite::Here());
  // The calling thread's lane: i + 1, or 0 outside lanes.
  std::size_t lane() const;
  // The index among all workers of the first worker here.
  std::size_t first_worker() const { return lane() == 0 ? 0 : groups_->first(lane() - 1); }
  // Gives each lane an uninitialised copy of tensors that every lane writes.
  void CopyForLanes(const std::vector<NamedTensor>& tensors);
  // The lane's copy of a tensor, if it has one; else the tensor itself.
  Tensor InLane(const Tensor& tensor) const;

  Tensor Empty(const Shape& shape, DType dtype) const;  // uninitialised
  Tensor Empty(const Shape& shape) const { return Empty(shape, dtype_); }
  Tensor Full(const Shape& shape, double value) const;  // dtype()
  Tensor Zeros(const Shape& shape, DType dtype) const;
  Tensor Zeros(const Shape& shape) const { return Zeros(shape, dtype_); }
  // Copies shape.elements() numbers from `values`, converted to dtype().
  Tensor From(const Shape& shape, std::span<const float> values) const;
  Tensor From(const Shape& shape, std::span<const double> values) const;
  Tensor Indices(std::span<const std::int32_t> values) const;  // [n] of kI32
  Tensor Copy(const Tensor& tensor) const;                     // with its own storage

  MemoryPool& memory() const { return *here().pool; }
  // For the small objects of a step (memory.h).
  template <class T>
  StepAllocator<T> allocator() const {
    return StepAllocator<T>(here().step_memory);
  }

  const Status& status() const { return here().status; }
  void Fail(Status status);  // keeps the first error
  Status TakeStatus();       // returns the error, if any, and clears it

  bool recording() const { return here().recording; }
  void set_recording(bool on) { here().recording = on; }
  std::uint64_t NextOrder() { return ++here().order; }  // creation order of graph nodes

 private:
  struct LaneCopy {
    const std::byte* of;  // the storage
    Tensor tensor;
  };
  // The state of one computing thread.
  struct Lane {
    explicit Lane(const Workers& workers);
    const Workers* workers;
    std::shared_ptr<MemoryPool> pool;
    std::shared_ptr<std::pmr::memory_resource> step_memory;
    KernelScratch scratch;
    Status status;
    bool recording = true;
    std::uint64_t order = 0;
    std::vector<LaneCopy> copies;
  };
  Lane& here() const { return *lanes_[lane()]; }

  DType dtype_;
  std::optional<WorkerGroups> groups_;
  std::vector<std::unique_ptr<Lane>> lanes_;  // the first: outside lanes
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

// One T per lane of a context and one for use outside lanes, each constructed from the workers
// there at its first use: what a computation keeps between calls, such as a renderer.
template <class T>
class PerLane {
 public:
  explicit PerLane(const Context& context)
      : context_(context), all_(context.lanes() == 1 ? 1 : context.lanes() + 1) {}
  T& Here() {
    std::unique_ptr<T>& here = all_[context_.lane()];
    if (!here) here = std::make_unique<T>(context_.workers());
    return *here;
  }

 private:
  const Context& context_;
  std::vector<std::unique_ptr<T>> all_;
};

// Evaluation without a backward pass: { NoGrad off(context); ... }
class NoGrad : public RecordingScope {
 public:
  explicit NoGrad(Context& context) : RecordingScope(context, false) {}
};

}  // namespace tilegrad::nn
