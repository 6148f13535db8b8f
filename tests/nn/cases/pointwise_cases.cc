// SPDX-License-Identifier: Apache-2.0
#include "nn/cases/cases.h"

namespace tilegrad::nn {
namespace {

struct UnaryCase {
  const char* name;
  Var (*function)(const Var&);
  double low = -1, high = 1;
};

// With kinks: on both sides of them, but further away than the step of the differences; squared, so
// that there is a second derivative.
const UnaryCase kUnary[] = {
    {"neg", [](const Var& x) { return Neg(x); }},
    {"scale", [](const Var& x) { return Scale(x, -1.7); }},
    {"add scalar", [](const Var& x) { return AddScalar(x, 0.3); }},
    {"exp", [](const Var& x) { return Exp(x); }},
    {"log", [](const Var& x) { return Log(x); }, 0.5, 2},
    {"sqrt", [](const Var& x) { return Sqrt(x); }, 0.5, 2},
    {"square", [](const Var& x) { return Square(x); }},
    {"tanh", [](const Var& x) { return Tanh(x); }},
    {"sigmoid", [](const Var& x) { return Sigmoid(x); }},
    {"softplus", [](const Var& x) { return Softplus(x); }, -3, 3},
    {"abs", [](const Var& x) { return Square(Abs(x)); }, 0.1, 1},
    {"abs below", [](const Var& x) { return Square(Abs(x)); }, -1, -0.1},
    {"relu", [](const Var& x) { return Square(Relu(x)); }, 0.1, 1},
    {"relu below", [](const Var& x) { return Square(Relu(x)); }, -1, -0.1},
    {"leaky relu", [](const Var& x) { return Square(LeakyRelu(x, 0.2)); }, 0.1, 1},
    {"leaky relu below", [](const Var& x) { return Square(LeakyRelu(x, 0.2)); }, -1, -0.1},
};

struct BinaryCase {
  const char* name;
  Var (*function)(const Var&, const Var&);
  InputSpec a, b;  // the ranges
};

// Of Max and Min one operand is larger everywhere, by more than the step.
const BinaryCase kBinary[] = {
    {"add", [](const Var& a, const Var& b) { return Add(a, b); }, {}, {}},
    {"sub", [](const Var& a, const Var& b) { return Sub(a, b); }, {}, {}},
    {"mul", [](const Var& a, const Var& b) { return Mul(a, b); }, {}, {}},
    {"div", [](const Var& a, const Var& b) { return Div(a, b); }, {}, {{}, 0.7, 2}},
};

InputSpec Shaped(InputSpec range, const Shape& shape) {
  range.shape = shape;
  return range;
}

}  // namespace

void AddPointwiseCases(CaseList& list) {
  for (const UnaryCase& c : kUnary) {
    const Shape shape = {list.Extent(), list.Extent(13)};
    list.Add(
        {c.name, [f = c.function](const Inputs& v) { return f(v[0]); }, {{shape, c.low, c.high}}});
  }
  const std::vector<std::pair<Shape, Shape>> shapes = {
      {{2, 13}, {2, 13}}, {{2, 11}, {11}},           {{4, 1}, {1, 5}},
      {{}, {3, 7}},       {{2, 3, 4, 1}, {3, 1, 5}}, {{2, 1, 3, 1, 2}, {1, 4, 1, 3, 2}}};
  for (const BinaryCase& c : kBinary) {
    for (const auto& [sa, sb] : shapes) {
      list.Add({c.name + (" " + sa.ToString()) + sb.ToString(),
                [f = c.function](const Inputs& v) { return f(v[0], v[1]); },
                {Shaped(c.a, sa), Shaped(c.b, sb)},
                48});
    }
  }
}

}  // namespace tilegrad::nn
