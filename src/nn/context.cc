// SPDX-License-Identifier: Apache-2.0
#include "nn/context.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "nn/kernels/panels.h"

namespace tilegrad::nn {
namespace {

constexpr std::size_t kGrain = 65536;         // numbers to a task
constexpr std::size_t kCopiedBytes = 524288;  // to a task

template <class From>
Tensor Converted(Tensor tensor, std::span<const From> values, const Workers& workers) {
  assert(values.size() == tensor.elements());
  WithFloatType(tensor.dtype(), [&]<class T>(T) {
    T* const to = tensor.data<T>();
    const std::size_t grain = GrainFor(values.size(), kGrain, workers);
    ForChunks(&workers, values.size(), grain, [&](std::size_t begin, std::size_t end) {
      std::copy(values.begin() + static_cast<std::ptrdiff_t>(begin),
                values.begin() + static_cast<std::ptrdiff_t>(end), to + begin);  // or moves bytes
    });
  });
  return tensor;
}

// Which lane of which context a thread is in.
struct Entered {
  const Context* context = nullptr;
  std::size_t lane = 0;
};
thread_local Entered t_entered;

// For a scope.
class Entering {
 public:
  explicit Entering(const Entered& now) : before_(std::exchange(t_entered, now)) {}
  ~Entering() { t_entered = before_; }
  Entering(const Entering&) = delete;
  Entering& operator=(const Entering&) = delete;

 private:
  Entered before_;
};

}  // namespace

Context::Lane::Lane(const Workers& w)
    : workers(&w), pool(MemoryPool::Make()), step_memory(MakeStepMemory()) {}

Context::Context(const Workers& workers, DType dtype) : dtype_(dtype) {
  assert(dtype == DType::kF32 || dtype == DType::kF64);
  lanes_.push_back(std::make_unique<Lane>(workers));
}

void Context::MakeLanes(std::size_t most) {
  assert(!groups_);
  if (most <= 1 || workers().count() == 1) return;
  groups_.emplace(workers(), most);
  for (std::size_t i = 0; i < groups_->count(); ++i)
    lanes_.push_back(std::make_unique<Lane>(groups_->group(i)));
}

std::size_t Context::lane() const { return t_entered.context == this ? t_entered.lane : 0; }

void Context::ForEachLane(FunctionRef<void(std::size_t)> task, LoopSite site) {
  if (!groups_) return task(0);
  const Lane& outside = here();
  const auto run = [&](std::size_t i) {
    const Entering entering({this, i + 1});
    here().recording = outside.recording;
    here().order = std::max(here().order, outside.order);  // above that of parameters
    task(i);
  };
  groups_->For(run, site);
}

void Context::CopyForLanes(const std::vector<NamedTensor>& tensors) {
  for (std::size_t i = 1; i < lanes_.size(); ++i) {
    for (const NamedTensor& t : tensors)
      lanes_[i]->copies.push_back({t.value.raw(), Copy(t.value)});
  }
}

Tensor Context::InLane(const Tensor& tensor) const {
  const std::vector<LaneCopy>& copies = here().copies;
  const auto found = std::ranges::find(copies, tensor.raw(), &LaneCopy::of);
  return found == copies.end() ? tensor : found->tensor;
}

Tensor Context::Empty(const Shape& shape, DType dtype) const {
  return {here().pool->Allocate(static_cast<std::size_t>(shape.elements()) * BytesOf(dtype)), shape,
          dtype};
}

Tensor Context::Zeros(const Shape& shape, DType dtype) const {
  Tensor zeros = Empty(shape, dtype);
  const std::size_t grain = GrainFor(zeros.bytes(), kCopiedBytes, workers());
  ForChunks(&workers(), zeros.bytes(), grain, [&](std::size_t begin, std::size_t end) {
    std::memset(zeros.raw() + begin, 0, end - begin);
  });
  return zeros;
}

Tensor Context::Full(const Shape& shape, double value) const {
  Tensor tensor = Empty(shape);
  WithFloatType(dtype_, [&]<class T>(T) {
    std::fill_n(tensor.data<T>(), tensor.elements(), static_cast<T>(value));
  });
  return tensor;
}

Tensor Context::From(const Shape& shape, std::span<const float> values) const {
  return Converted(Empty(shape), values, workers());
}

Tensor Context::From(const Shape& shape, std::span<const double> values) const {
  return Converted(Empty(shape), values, workers());
}

Tensor Context::Indices(std::span<const std::int32_t> values) const {
  Tensor tensor = Empty({static_cast<std::int64_t>(values.size())}, DType::kI32);
  std::copy(values.begin(), values.end(), tensor.data<std::int32_t>());
  return tensor;
}

Tensor Context::Copy(const Tensor& tensor) const {
  Tensor copy = Empty(tensor.shape(), tensor.dtype());
  const std::size_t grain = GrainFor(tensor.bytes(), kCopiedBytes, workers());
  ForChunks(&workers(), tensor.bytes(), grain, [&](std::size_t begin, std::size_t end) {
    std::memcpy(copy.raw() + begin, tensor.raw() + begin, end - begin);
  });
  return copy;
}

void Context::Fail(Status status) {
  if (here().status.ok()) here().status = std::move(status);
}

Status Context::TakeStatus() { return std::exchange(here().status, Status()); }

}  // namespace tilegrad::nn
