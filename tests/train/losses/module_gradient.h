// SPDX-License-Identifier: Apache-2.0
// The gradient of a loss by a module's weights, or by other leaves, against differences in double.
#pragma once

#include <cstring>
#include <functional>
#include <vector>

#include "nn/gradient_check.h"

namespace tilegrad::train {

// The loss with other values of the leaves, which keep their own afterwards.
inline double LossAt(std::vector<nn::Var> leaves, const nn::Inputs& values,
                     const std::function<nn::Var()>& loss) {
  std::vector<nn::Tensor> before;
  for (std::size_t i = 0; i < values.size(); ++i) {
    before.push_back(leaves[i].context().Copy(leaves[i].value()));
    std::memcpy(leaves[i].value().raw(), values[i].value().raw(), before[i].bytes());
  }
  const double result = loss().item();
  for (std::size_t i = 0; i < values.size(); ++i)
    std::memcpy(leaves[i].value().raw(), before[i].raw(), before[i].bytes());
  return result;
}

// Along a random direction of all leaves: to 1e-6 of the slope, and what rounding leaves of a
// difference of two losses, 16 eps loss / step. The step is small because a rectifier of the many
// must not pass its kink.
inline void ExpectGradientBy(const std::vector<nn::Var>& leaves,
                             const std::function<nn::Var()>& loss, Rng& rng) {
  nn::Context& context = leaves[0].context();
  const nn::Var value = loss();
  ASSERT_TRUE(value.valid()) << context.status().message();
  const auto gradient = nn::Grad(value, leaves);
  ASSERT_TRUE(context.status().ok()) << context.status().message();
  nn::Inputs along;
  for (const nn::Var& leaf : leaves)
    along.push_back(nn::RandomConstant(context, leaf.shape(), rng));
  constexpr double kStep = 1e-6;
  const double rounding = 16 * 0x1.0p-52 * std::abs(value.item()) / kStep;
  const double slope = nn::Slope(
      [&](const nn::Inputs& moved) { return LossAt(leaves, moved, loss); }, leaves, along, kStep);
  EXPECT_NEAR(nn::Dot(gradient, along), slope, 1e-6 * std::abs(slope) + rounding);
  EXPECT_GT(std::abs(slope), 1000 * rounding);
}

inline std::vector<nn::Var> WeightsOf(nn::Module& module) {
  std::vector<nn::Var> out;
  for (const nn::NamedVar& p : nn::Parameters(module)) out.push_back(p.value);
  return out;
}

}  // namespace tilegrad::train
