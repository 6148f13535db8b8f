// SPDX-License-Identifier: Apache-2.0
#include "nn/moving_average.h"

#include <string_view>
#include <utility>

#include "nn/kernels/update.h"

namespace tilegrad::nn {
namespace {

constexpr std::string_view kPrefix = "ema.";

}  // namespace

MovingAverage::MovingAverage(Context& context, std::vector<NamedTensor> tensors, double decay)
    : context_(context), decay_(decay), tensors_(std::move(tensors)) {
  for (const NamedTensor& t : tensors_) averages_.push_back({t.name, context.Copy(t.value)});
}

void MovingAverage::Update() {
  for (std::size_t i = 0; i < tensors_.size(); ++i) {
    const Tensor& from = tensors_[i].value;
    WithFloatType(from.dtype(), [&]<class T>(T) {
      Blend({from.elements(), decay_}, from.data<T>(), averages_[i].value.data<T>(),
            context_.workers());
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
