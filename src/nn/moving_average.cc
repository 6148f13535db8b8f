// SPDX-License-Identifier: Apache-2.0
#include "nn/moving_average.h"

#include <cstddef>
#include <span>
#include <string_view>
#include <utility>

#include "base/parallel.h"

namespace tilegrad::nn {
namespace {

constexpr std::string_view kPrefix = "ema.";
constexpr std::size_t kUpdateGrain = 65536;  // elements to a task

// y = decay y + (1 - decay) x. Memory bounds it, and every compiler vectorises it.
template <class T>
void Blend(double decay, std::span<const T> x, std::span<T> y, const Workers& workers) {
  const auto old = static_cast<T>(decay), rest = static_cast<T>(1 - decay);
  workers.ForRanges(x.size(), kUpdateGrain, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t i = begin; i < end; ++i) y[i] = old * y[i] + rest * x[i];
  });
}

}  // namespace

MovingAverage::MovingAverage(Context& context, std::vector<NamedTensor> tensors, double decay)
    : context_(context), decay_(decay), tensors_(std::move(tensors)) {
  for (const NamedTensor& t : tensors_) averages_.push_back({t.name, context.Copy(t.value)});
}

void MovingAverage::Update() {
  for (std::size_t i = 0; i < tensors_.size(); ++i) {
    const Tensor& from = tensors_[i].value;
    WithFloatType(from.dtype(), [&]<class T>(T) {
      Blend<T>(decay_, from.span<T>(), averages_[i].value.span<T>(), context_.workers());
    });
  }
}

std::vector<NamedTensor> MovingAverage::State() const {
  std::vector<NamedTensor> state = averages_;
  for (NamedTensor& t : state) t.name = std::string(kPrefix) + t.name;
  return state;
}

std::vector<NamedTensor> Averages(const std::vector<NamedTensor>& state) {
  std::vector<NamedTensor> averages;
  for (const NamedTensor& t : state) {
    if (t.name.starts_with(kPrefix)) averages.push_back({t.name.substr(kPrefix.size()), t.value});
  }
  return averages;
}

}  // namespace tilegrad::nn
