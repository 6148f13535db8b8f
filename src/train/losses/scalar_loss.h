// SPDX-License-Identifier: Apache-2.0
// How a loss that is written by hand joins the tape.
#pragma once

#include "nn/kernels/pointwise.h"
#include "nn/tape.h"

namespace tilegrad::train {

// `value` as a scalar Var whose gradient with respect to `input` is `gradient`, computed beforehand
// with the value.
inline nn::Var ScalarLoss(const char* name, const nn::Var& input, double value,
                          nn::Tensor gradient) {
  nn::Context& context = input.context();
  nn::Tensor output = context.Empty({}, input.dtype());
  nn::WithFloatType(input.dtype(), [&]<class T>(T) { *output.data<T>() = static_cast<T>(value); });
  auto backward = [gradient, &context](std::span<const nn::Tensor> d_outputs) {
    if (d_outputs[0].empty()) return std::vector<nn::Tensor>(1);
    return nn::WithFloatType(gradient.dtype(), [&]<class T>(T) {
      const T factor = *d_outputs[0].data<T>();
      if (factor == T(1)) return std::vector<nn::Tensor>{gradient};
      nn::Tensor scaled = context.Empty(gradient.shape(), gradient.dtype());
      nn::Unary(nn::UnaryProblem<T>{nn::UnaryOp::kScale, gradient.data<T>(), scaled.data<T>(),
                                    gradient.elements(), static_cast<double>(factor)},
                context.workers());
      return std::vector<nn::Tensor>{scaled};
    });
  };
  return nn::External(
      context,
      {.name = name, .inputs = {input}, .outputs = {output}, .backward = std::move(backward)})[0];
}

}  // namespace tilegrad::train
