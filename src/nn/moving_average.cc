// SPDX-License-Identifier: Apache-2.0
#include "nn/moving_average.h"

#include <utility>

#include "nn/kernels/update.h"

namespace tilegrad::nn {

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
  for (NamedTensor& t : state) t.name = "ema." + t.name;
  return state;
}

}  // namespace tilegrad::nn
