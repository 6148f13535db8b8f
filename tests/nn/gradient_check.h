// SPDX-License-Identifier: Apache-2.0
// Derivatives of functions of Vars: in double against central differences, in float against double.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <numeric>
#include <span>
#include <vector>

#include "base/rng.h"
#include "nn/cases/cases.h"
#include "nn/nn.h"

namespace tilegrad::nn {

// A parameter of an F64 context. Its numbers are floats, so that an F32 context can have the same.
inline Var RandomParameter(Context& context, const InputSpec& spec, Rng& rng) {
  Tensor tensor = context.Empty(spec.shape);
  const auto values = tensor.span<double>();
  if (spec.separated) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      const double middle = static_cast<double>(i) + 0.5;
      values[i] = spec.low + (spec.high - spec.low) * middle / static_cast<double>(values.size());
    }
    for (std::size_t i = values.size(); i > 1; --i) std::swap(values[i - 1], values[rng.Below(i)]);
  } else {
    FillUniform(tensor, rng, spec.low, spec.high);
  }
  for (double& v : values) v = static_cast<double>(static_cast<float>(v));
  return Parameter(context, tensor);
}

inline Var RandomConstant(Context& context, const Shape& shape, Rng& rng) {
  return Detach(RandomParameter(context, {shape}, rng));
}

// The derivative of a scalar f at `inputs` along `direction`, by central differences of fourth
// order: error about h^4 |f^(5)| / 30 + 2 eps |f| / h.
inline double Slope(const std::function<double(const Inputs&)>& f, const Inputs& inputs,
                    const Inputs& direction, double h = 1e-3) {
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
  return (8.0 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12.0 * h);
}

inline double Dot(std::span<const Var> a, std::span<const Var> b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const auto x = a[i].value().span<double>(), y = b[i].value().span<double>();
    sum = std::inner_product(x.begin(), x.end(), y.begin(), sum);
  }
  return sum;
}

inline std::vector<double> Numbers(const Var& v) {
  if (!v.valid()) return {};
  const auto span = v.value().span<double>();
  return {span.begin(), span.end()};
}

// What a case is examined at: its inputs, and the random numbers that make scalars of it.
struct Leaves {
  Inputs x;                 // the inputs
  Inputs direction, probe;  // of their shapes
  Inputs weights;           // one, of the output's shape

  Inputs All() const {
    Inputs all = x;
    for (const Inputs* more : {&direction, &probe, &weights}) {
      all.insert(all.end(), more->begin(), more->end());
    }
    return all;
  }
};

inline Var WeightedSum(std::span<const Var> a, std::span<const Var> b) {
  Var sum = Sum(Mul(a[0], b[0]));
  for (std::size_t i = 1; i < a.size(); ++i) sum = sum + Sum(Mul(a[i], b[i]));
  return sum;
}

// The scalars that are compared. With g the gradient of s = weights . f(x):
//   first  = direction . g
//   t      = probe . g + |g|^2 / 2,  as a gradient penalty has it
//   second = direction . dt/dx,      which mixes all second derivatives
struct Derivatives {
  Var s, first, t, second;
};

inline Derivatives Differentiate(const Function& f, const Leaves& at) {
  Derivatives d;
  d.s = WeightedSum(at.weights, Inputs{f(at.x)});
  const auto g = Grad(d.s, at.x, {.create_graph = true});
  d.first = WeightedSum(at.direction, g);
  d.t = WeightedSum(at.probe, g) + 0.5 * WeightedSum(g, g);
  d.second = WeightedSum(at.direction, Grad(d.t, at.x, {.create_graph = true}));
  return d;
}

inline Leaves RandomLeaves(Context& context, const OpCase& c, Rng& rng) {
  Leaves leaves;
  for (const InputSpec& spec : c.inputs) {
    leaves.x.push_back(RandomParameter(context, spec, rng));
    leaves.direction.push_back(RandomParameter(context, {spec.shape}, rng));
    leaves.probe.push_back(RandomParameter(context, {spec.shape}, rng));
  }
  const Var y = c.function(leaves.x);
  if (y.valid()) leaves.weights.push_back(RandomParameter(context, {y.shape()}, rng));
  return leaves;
}

// In double against differences. With h = 1e-3, functions of scale 1 and directions of length about
// 1, the difference quotient is good to about 1e-12 / 1e-3 (rounding) + 1e-12 f^(5) / 30
// (truncation): 1e-8 relative leaves two digits.
inline void ExpectSlopes(const Function& f, const Leaves& at, const Derivatives& d,
                         double tolerance = 1e-8) {
  const auto along = [&](auto&& pick) {
    const auto value = [&](const Inputs& x) {
      Leaves moved = at;
      moved.x = x;
      return pick(Differentiate(f, moved)).item();
    };
    return Slope(value, at.x, at.direction);
  };
  const double first = d.first.item(), second = d.second.item();
  EXPECT_NEAR(first, along([](const Derivatives& e) { return e.s; }),
              tolerance * (1.0 + std::abs(first)))
      << "first derivative";
  EXPECT_NEAR(second, along([](const Derivatives& e) { return e.t; }),
              tolerance * (1.0 + std::abs(second)))
      << "second derivative";
}

// How far a scalar moves, relative to the moves of the numbers it is computed from:
// sum |d q / d leaf| |leaf|.
inline double Condition(const Var& q, const Leaves& at) {
  const Inputs all = at.All();
  const auto d = Grad(q, all, {.keep_graph = true});
  double sum = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto x = all[i].value().span<double>(), dx = d[i].value().span<double>();
    for (std::size_t k = 0; k < x.size(); ++k) sum += std::abs(x[k] * dx[k]);
  }
  return sum;
}

inline Leaves InFloat(Context& context, const Leaves& leaves) {
  const auto convert = [&](const Inputs& from) {
    Inputs to;
    for (const Var& v : from) {
      to.push_back(Parameter(context, context.From(v.shape(), v.value().span<double>())));
    }
    return to;
  };
  return {convert(leaves.x), convert(leaves.direction), convert(leaves.probe),
          convert(leaves.weights)};
}

// In float against double: where each number passes through n roundings, and none is enlarged by
// cancellation of more than the inputs' own, the result is that of inputs moved by at most n u each
// (u = 2^-24), hence off by n u Condition. A derivative reads two rounded numbers where the
// function reads one, and rounds again as often: three times n for each order.
inline void ExpectFloatAgrees(const OpCase& c, const Derivatives& want,
                              const std::vector<double>& condition, const Derivatives& got) {
  const double unit = c.roundings * 0x1.0p-24;
  const auto near = [&](const Var& a, const Var& b, double bound) {
    EXPECT_NEAR(a.item(), b.item(), bound);
  };
  near(got.s, want.s, unit * condition[0]);
  near(got.first, want.first, 3 * unit * condition[1]);
  near(got.second, want.second, 9 * unit * condition[2]);
}

// The loss with other values of the leaves, which keep their own afterwards.
inline double LossAt(std::vector<Var> leaves, const Inputs& values,
                     const std::function<Var()>& loss) {
  std::vector<Tensor> before;
  for (std::size_t i = 0; i < values.size(); ++i) {
    before.push_back(leaves[i].context().Copy(leaves[i].value()));
    std::memcpy(leaves[i].value().raw(), values[i].value().raw(), before[i].bytes());
  }
  const double result = loss().item();
  for (std::size_t i = 0; i < values.size(); ++i)
    std::memcpy(leaves[i].value().raw(), before[i].raw(), before[i].bytes());
  return result;
}

// Against differences in double, along a random direction of all leaves and then of each: to 1e-6
// of the slope, and what rounding leaves of a difference of two losses, 16 eps loss / step. The
// step is small because a rectifier of the many must not pass its kink.
inline void ExpectGradientBy(const std::vector<Var>& leaves, const std::function<Var()>& loss,
                             Rng& rng) {
  Context& context = leaves[0].context();
  const Var value = loss();
  ASSERT_TRUE(value.valid()) << context.status().message();
  const auto gradient = Grad(value, leaves);
  ASSERT_TRUE(context.status().ok()) << context.status().message();
  Inputs direction, none;
  for (const Var& leaf : leaves) {
    direction.push_back(RandomConstant(context, leaf.shape(), rng));
    none.push_back(Constant(context, context.Zeros(leaf.shape())));
  }
  constexpr double kStep = 1e-6;
  const double rounding = 16 * 0x1.0p-52 * std::abs(value.item()) / kStep;
  const auto check = [&](const Inputs& along) {
    const double slope = Slope([&](const Inputs& moved) { return LossAt(leaves, moved, loss); },
                               leaves, along, kStep);
    EXPECT_NEAR(Dot(gradient, along), slope, 1e-6 * std::abs(slope) + rounding);
    return slope;
  };
  EXPECT_GT(std::abs(check(direction)), 1000 * rounding);
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    Inputs one = none;
    one[i] = direction[i];
    check(one);
  }
}

inline std::vector<Var> WeightsOf(Module& module) {
  std::vector<Var> out;
  for (const NamedVar& p : Parameters(module)) out.push_back(p.value);
  return out;
}

}  // namespace tilegrad::nn
