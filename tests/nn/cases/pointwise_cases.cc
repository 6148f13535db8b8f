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

void AddReduceCases(CaseList& list) {
  const Shape shape = {list.Extent(), list.Extent(), list.Extent(5), 1 + list.Extent(18)};
  const int roundings = 16 + static_cast<int>(shape.elements());
  const auto add = [&](const std::string& name, const std::function<Var(const Var&)>& f) {
    list.Add({name,
              [f](const Inputs& v) { return Square(f(v[0])); },
              {{shape, -0.7, 1, /*separated=*/true}},
              roundings});
  };
  add("sum", [](const Var& x) { return Sum(x); });
  add("mean", [](const Var& x) { return Mean(x); });
  for (const Keep keep : {Keep::kNo, Keep::kYes}) {
    add("sum 0", [=](const Var& x) { return Sum(x, {0}, keep); });
    add("sum 1 3", [=](const Var& x) { return Sum(x, {1, 3}, keep); });
    add("sum 0 2 3", [=](const Var& x) { return Sum(x, {0, 2, 3}, keep); });
    add("mean 2", [=](const Var& x) { return Mean(x, {2}, keep); });
    add("reduce max 1 2", [=](const Var& x) { return ReduceMax(x, {1, 2}, keep); });
    add("reduce min 3", [=](const Var& x) { return ReduceMin(x, {3}, keep); });
  }
  list.Add({"sum to",
            [](const Inputs& v) {
              return Square(SumTo(v[0], {3, 1, 2}));
            },
            {{{2, 3, 4, 2}}},
            32});
}

void AddShapeCases(CaseList& list) {
  const Shape shape = {2, 3, 4 + list.Extent(9)};
  const auto add = [&](const std::string& name, const std::function<Var(const Var&)>& f) {
    list.Add({name, [f](const Inputs& v) { return Square(f(v[0])); }, {{shape}}, 32});
  };
  add("reshape", [](const Var& x) { return Reshape(x, {3, -1}); });
  add("broadcast", [s = shape](const Var& x) { return BroadcastTo(x, {3, s[0], s[1], s[2]}); });
  add("permute", [](const Var& x) { return Permute(x, {2, 0, 1}); });
  add("concat", [](const Var& x) { return Concat({x, Scale(x, 2.0), x}, 1); });
  for (int axis = 0; axis < 3; ++axis) {
    add("slice", [=](const Var& x) { return Slice(x, axis, 1, 2); });
    add("pad", [=](const Var& x) { return Pad(x, axis, 2, 1); });
    add("gather", [=](const Var& x) {
      const std::vector<std::int32_t> indices = {1, 0, 1, 1, 0};
      return Gather(x, axis, x.context().Indices(indices));
    });
  }
  const std::vector<std::int32_t> picks = {1, 0, 1, 3, 3, 3};
  const auto pick = [picks](const Var& x) { return x.context().Indices(picks); };
  list.Add({"take along",
            [pick](const Inputs& v) {
              return Square(TakeAlong(v[0], pick(v[0]).Reshaped({2, 3})));
            },
            {{{2, 4}}},
            32});
  list.Add({"place along",
            [pick](const Inputs& v) {
              return Square(PlaceAlong(v[0], pick(v[0]).Reshaped({2, 3}), 5));
            },
            {{{2, 3}}},
            32});
  list.Add({"broadcast 1",
            [](const Inputs& v) {
              return Square(BroadcastTo(v[0], {2, 3, 4}));
            },
            {{{3, 1}}},
            32});
  list.Add({"transpose", [](const Inputs& v) { return Square(Transpose(v[0])); }, {{{2, 5}}}});
  list.Add({"scatter add",
            [](const Inputs& v) {
              const std::vector<std::int32_t> indices = {2, 0, 2, 2, 1};
              return Square(ScatterAdd(v[0], 0, v[0].context().Indices(indices), 4));
            },
            {{{5, list.Extent(9)}}},
            32});
}

void AddSoftmaxCases(CaseList& list) {
  const Shape shape = {2, list.Extent(3), 1 + list.Extent(9)};
  for (int axis = 0; axis < 3; ++axis) {
    const InputSpec x = {shape, -3, 3, /*separated=*/true};
    list.Add({"softmax", [=](const Inputs& v) { return Softmax(v[0], axis); }, {x}, 64});
    list.Add({"log softmax", [=](const Inputs& v) { return LogSoftmax(v[0], axis); }, {x}, 64});
  }
  const InputSpec logits = {{4, 5}, -3, 3, true};
  list.Add({"cross-entropy",
            [](const Inputs& v) {
              const std::vector<std::int32_t> labels = {4, 0, 2, 2};
              return CrossEntropy(v[0], v[0].context().Indices(labels));
            },
            {logits},
            96});
}

}  // namespace tilegrad::nn
