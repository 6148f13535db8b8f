// SPDX-License-Identifier: Apache-2.0
// Derivatives of functions of Vars held against central differences in double.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "base/rng.h"
#include "nn/nn.h"

namespace tilegrad::nn {

using Inputs = std::vector<Var>;
using Function = std::function<Var(const Inputs&)>;  // any shape

inline Var RandomParameter(Context& context, const Shape& shape, Rng& rng, double low = -1.0,
                           double high = 1.0) {
  Tensor tensor = context.Empty(shape);
  FillUniform(tensor, rng, low, high);
  return Parameter(context, tensor);
}

inline Var RandomConstant(Context& context, const Shape& shape, Rng& rng) {
  return Detach(RandomParameter(context, shape, rng));
}

// The derivative of a scalar f at `inputs` along `direction`, by central differences of fourth
// order: error about h^4 |f^(5)| / 30 + 2 eps |f| / h.
inline double Slope(const std::function<double(const Inputs&)>& f, const Inputs& inputs,
                    const Inputs& direction) {
  const auto at = [&](double step) {
    Inputs moved;
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      Context& context = inputs[i].context();
      Tensor t = context.Copy(inputs[i].value());
      for (std::size_t k = 0; k < t.elements(); ++k) {
        t.data<double>()[k] += step * direction[i].value().data<double>()[k];
      }
      moved.push_back(Parameter(context, t));
    }
    return f(moved);
  };
  const double h = 1e-3;
  return (8.0 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12.0 * h);
}

inline double Dot(const std::vector<Var>& a, const std::vector<Var>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t k = 0; k < a[i].value().elements(); ++k) {
      sum += a[i].value().data<double>()[k] * b[i].value().data<double>()[k];
    }
  }
  return sum;
}

// First derivative of s(inputs) = sum weights f(inputs) and of |ds/dinputs|^2-like contractions of
// it (which is what a gradient penalty differentiates), each along random directions. With h =
// 1e-3, functions of scale 1 and directions of length about 1, the difference quotient is good to
// about 1e-12 / 1e-3 (rounding) + 1e-12 f^(5) / 30 (truncation): 1e-8 relative leaves two digits.
inline void CheckDerivatives(Context& context, const Function& f, const Inputs& inputs, Rng& rng,
                             double tolerance = 1e-8) {
  const Var shape_of = f(inputs);
  ASSERT_TRUE(shape_of.valid()) << context.status().message();
  const Var weights = RandomConstant(context, shape_of.shape(), rng);
  const auto scalar = [&](const Inputs& x) { return Sum(Mul(weights, f(x))); };
  Inputs direction, probe;
  for (const Var& x : inputs) {
    direction.push_back(RandomConstant(context, x.shape(), rng));
    probe.push_back(RandomConstant(context, x.shape(), rng));
  }
  const auto gradient = Grad(scalar(inputs), inputs);
  ASSERT_TRUE(context.status().ok()) << context.status().message();
  const double first = Dot(gradient, direction);
  const double first_slope =
      Slope([&](const Inputs& x) { return scalar(x).item(); }, inputs, direction);
  EXPECT_NEAR(first, first_slope, tolerance * (1.0 + std::abs(first))) << "first derivative";

  // t(inputs) = sum_i probe_i . g_i + |g_i|^2 / 2 with g the gradient, so dt mixes all second
  // derivatives and those of third order rules that a graph of gradients records.
  const auto contracted = [&](const Inputs& x) {
    const auto g = Grad(scalar(x), x, {.create_graph = true});
    Var t = Constant(context, 0.0);
    for (std::size_t i = 0; i < x.size(); ++i) {
      t = t + Sum(Mul(probe[i], g[i])) + 0.5 * Sum(Square(g[i]));
    }
    return t;
  };
  // Where f is linear the gradient is a constant without a graph, and its slope has to be zero.
  const Var t = contracted(inputs);
  const double second = t.requires_grad() ? Dot(Grad(t, inputs), direction) : 0.0;
  ASSERT_TRUE(context.status().ok()) << context.status().message();
  const double second_slope =
      Slope([&](const Inputs& x) { return contracted(x).item(); }, inputs, direction);
  EXPECT_NEAR(second, second_slope, tolerance * (1.0 + std::abs(second))) << "second derivative";
}

}  // namespace tilegrad::nn
