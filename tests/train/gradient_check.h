// SPDX-License-Identifier: Apache-2.0
// Gradients of functions on the tape against central differences in float64.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "base/rng.h"
#include "nn/nn.h"
#include "train/run/log.h"

namespace tilegrad::train {

// NaN if there is none of that name.
inline double TermOf(const StepValues& values, const std::string& name) {
  for (const LossTerm& term : values.terms) {
    if (name == term.name) return term.value;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

inline std::vector<double> Uniform(std::size_t n, double low, double high, std::uint64_t seed) {
  Rng rng(seed);
  std::vector<double> out(n);
  for (double& x : out) x = rng.Uniform(low, high);
  return out;
}

// Some entries of each parameter, drawn by `rng`, against central differences in float64 of a loss
// with kinks. With h = 1e-6 crossings of a kink are improbable, truncation is O(h^2) = 1e-12 and
// rounding 1e-16 / h = 1e-10 of the loss: 1e-5 relative and `floor` are what can be asked.
// Entries beyond these are `off`, and still within 5 % and `kink`.
struct Differences {
  int checked = 0, off = 0;
  int moving = 0;  // entries with a gradient
};
inline Differences CompareWithDifferences(const std::vector<nn::Var>& parameters,
                                          const std::function<double()>& loss,
                                          std::span<const nn::Var> gradients, int entries,
                                          double floor, Rng& rng, double kink) {
  Differences out;
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    nn::Var parameter = parameters[p];  // shares its memory
    for (int k = 0; k < entries; ++k, ++out.checked) {
      const std::size_t at = rng.Below(parameter.value().elements());
      double& number = parameter.value().data<double>()[at];
      const double h = 1e-6, before = number;
      const auto loss_at = [&](double x) {
        number = x;
        return loss();
      };
      const double up = loss_at(before + h), want = (up - loss_at(before - h)) / (2 * h);
      number = before;
      const double got = gradients[p].value().data<double>()[at];
      out.moving += std::abs(got) > 1e-9;
      if (std::abs(got - want) <= 1e-5 * std::abs(want) + floor) continue;
      ++out.off;
      EXPECT_NEAR(got, want, 0.05 * std::abs(want) + kink) << p << "[" << at << "]";
    }
  }
  return out;
}

class GradientCheck : public testing::Test {
 protected:
  using Function = std::function<nn::Var(const nn::Var&)>;

  GradientCheck() : workers_(2), context_(workers_, nn::DType::kF64) {}

  nn::Var Const(const nn::Shape& shape, const std::vector<double>& x) {
    return nn::Constant(context_, context_.From(shape, std::span<const double>(x)));
  }
  nn::Tensor Random(const nn::Shape& shape, double low, double high, std::uint64_t seed) {
    const auto n = static_cast<std::size_t>(shape.elements());
    return context_.From(shape, std::span<const double>(Uniform(n, low, high, seed)));
  }
  double Value(const Function& f, const nn::Shape& shape, const std::vector<double>& x) {
    return f(Const(shape, x)).item();
  }
  // Of 3 f where f is a number, which shows a gradient that forgets what comes from above, else of
  // a fixed weighted sum of its elements. Central differences with h = 1e-6: the truncation is
  // h^2 f'''/6 ~ 1e-12, the rounding eps f / h ~ 2e-10 for f ~ 1; 1e-7 relative to the largest
  // entry leaves room for sums of thousands.
  void ExpectGradient(const Function& f, const nn::Shape& shape, std::vector<double> x) {
    const Function weighed = [&](const nn::Var& at) {
      const nn::Var y = f(at);
      if (y.shape().elements() == 1) return 3.0 * y;
      return nn::Sum(y * Const(y.shape(), Uniform(y.value().elements(), -1, 1, 99)));
    };
    const nn::Var input = nn::Parameter(context_, context_.From(shape, std::span<const double>(x)));
    const nn::Tensor gradient = nn::Grad(weighed(input), {input})[0].value();
    ASSERT_TRUE(context_.status().ok()) << context_.status().message();
    double largest = 0;
    for (const double g : gradient.span<double>()) largest = std::max(largest, std::abs(g));
    ASSERT_GT(largest, 0);
    for (std::size_t i = 0; i < x.size(); ++i) {
      const double h = 1e-6, at = x[i];
      x[i] = at + h;
      const double up = Value(weighed, shape, x);
      x[i] = at - h;
      const double down = Value(weighed, shape, x);
      x[i] = at;
      EXPECT_NEAR(gradient.data<double>()[i], (up - down) / (2 * h), 1e-7 * (1 + largest)) << i;
    }
  }

  Workers workers_;
  nn::Context context_;
};

}  // namespace tilegrad::train
