// SPDX-License-Identifier: Apache-2.0

#include "nn/kernels/reduce.h"

#include <array>
#include <limits>
#include <utility>

#include "base/error.h"
#include "nn/ops.h"
#include "nn/ops/broadcast.h"

namespace tilegrad::nn {
namespace {

using AxisSet = std::array<bool, Shape::kMaxRank>;

struct Reduction {
  AxisSet reduced{};
  ReduceLayout layout;
  Shape kept_as_one;  // the result with Keep::kYes
  Shape dropped;      // with Keep::kNo
};

// Splits the axes into runs that are kept and runs that are reduced. Five axes make at most five
// runs, which fit into the six places of a ReduceLayout.
Reduction Plan(const Shape& shape, const AxisSet& reduced) {
  Reduction plan{reduced, {}, {}, {}};
  std::size_t place = 0;  // 0: k0, 1: r0, 2: k1, ...
  for (int axis = 0; axis < shape.rank(); ++axis) {
    const bool is_reduced = reduced[static_cast<std::size_t>(axis)];
    const std::int64_t extent = shape[axis];
    plan.kept_as_one.Append(is_reduced ? 1 : extent);
    if (!is_reduced) plan.dropped.Append(extent);
    if (extent == 1) continue;
    if ((place % 2 == 1) != is_reduced) ++place;
    auto& places = is_reduced ? plan.layout.reduced : plan.layout.kept;
    places[place / 2] *= static_cast<std::size_t>(extent);
  }
  return plan;
}

Status ParseAxes(const char* op, const Shape& shape, std::initializer_list<int> axes,
                 AxisSet& set) {
  for (int axis : axes) {
    if (axis < 0 || axis >= shape.rank())
      return InvalidArgument("{}: axis {} of shape {}", op, axis, shape);
    set[static_cast<std::size_t>(axis)] = true;
  }
  return {};
}

AxisSet AllAxes(const Shape& shape) {
  AxisSet set{};
  std::fill_n(set.begin(), shape.rank(), true);
  return set;
}

Var SumOver(const Var& x, const AxisSet& axes, Keep keep) {
  const Reduction plan = Plan(x.shape(), axes);
  Tensor y = x.context().Empty(keep == Keep::kYes ? plan.kept_as_one : plan.dropped, x.dtype());
  WithFloatType(x.dtype(), [&]<class T>(T) {
    ReduceSum(plan.layout, x.value().data<T>(), y.data<T>(), x.context().workers());
  });
  const auto rule = [shape = x.shape(), kept = plan.kept_as_one](const Adjoint& adj) {
    return Vars{BroadcastTo(Reshape(adj.dy(), kept), shape)};
  };
  return Record({"sum"}, std::move(y), {x}, rule);
}

Var MeanOf(const Var& x, const Var& sum, std::size_t count) {
  if (count > 0) return Scale(sum, 1.0 / static_cast<double>(count));
  return Refuse(x, "mean: shape {} has nothing to average", x.shape());
}

struct ExtremumCall {
  const char* name;
  int sign;
};

// The gradient goes to the elements that were picked: a scatter over the flattened input.
Var Extremum(const ExtremumCall& call, const Var& x, const AxisSet& axes, Keep keep) {
  const Reduction plan = Plan(x.shape(), axes);
  if (plan.layout.inputs_each() == 0 ||
      x.shape().elements() > std::numeric_limits<std::int32_t>::max()) {
    return Refuse(x, "{}: shape {} is empty or too large", call.name, x.shape());
  }
  Context& context = x.context();
  Tensor y = context.Empty(keep == Keep::kYes ? plan.kept_as_one : plan.dropped, x.dtype());
  Tensor first = context.Empty({y.shape().elements()}, DType::kI32);
  WithFloatType(x.dtype(), [&]<class T>(T) {
    ReduceExtremum(plan.layout, x.value().data<T>(), y.data<T>(),
                   {call.sign, first.data<std::int32_t>()}, context.workers());
  });
  const auto rule = [shape = x.shape(), first](const Adjoint& adj) {
    const Var flat = Reshape(adj.dy(), {adj.dy().shape().elements()});
    return Vars{Reshape(ScatterAdd(flat, 0, first, shape.elements()), shape)};
  };
  return Record({call.name}, std::move(y), {x}, rule);
}

Var ExtremumOver(const ExtremumCall& call, const Var& x, std::initializer_list<int> axes,
                 Keep keep) {
  if (!Usable(call.name, {&x})) return Invalid({&x});
  AxisSet set{};
  if (const Status status = ParseAxes(call.name, x.shape(), axes, set); !status.ok())
    return Fail(x, status);
  return Extremum(call, x, set, keep);
}

// x minus its largest element along the axis, which is a constant: every function below is the same
// for any constant.
Var Lowered(const Var& x, int axis) { return Sub(x, Detach(ReduceMax(x, {axis}, Keep::kYes))); }

bool AreLogits(const Var& logits, std::int64_t rows) {
  return logits.shape().rank() == 2 && logits.shape()[0] == rows && rows > 0;
}

}  // namespace

Var Sum(const Var& x, std::initializer_list<int> axes, Keep keep) {
  if (!Usable("sum", {&x})) return Invalid({&x});
  AxisSet set{};
  if (const Status status = ParseAxes("sum", x.shape(), axes, set); !status.ok())
    return Fail(x, status);
  return SumOver(x, set, keep);
}

Var Sum(const Var& x) {
  if (!Usable("sum", {&x})) return Invalid({&x});
  return SumOver(x, AllAxes(x.shape()), Keep::kNo);
}

Var Mean(const Var& x, std::initializer_list<int> axes, Keep keep) {
  Var sum = Sum(x, axes, keep);
  if (!sum.valid()) return sum;
  AxisSet set{};
  const Status status = ParseAxes("mean", x.shape(), axes, set);
  if (!status.ok()) return Fail(x, status);
  return MeanOf(x, sum, Plan(x.shape(), set).layout.inputs_each());
}

Var Mean(const Var& x) {
  const Var sum = Sum(x);
  return sum.valid() ? MeanOf(x, sum, x.value().elements()) : sum;
}

Var ReduceMax(const Var& x, std::initializer_list<int> axes, Keep keep) {
  return ExtremumOver({"reduce max", 1}, x, axes, keep);
}

Var ReduceMin(const Var& x, std::initializer_list<int> axes, Keep keep) {
  return ExtremumOver({"reduce min", -1}, x, axes, keep);
}

Var SumTo(const Var& x, const Shape& shape) {
  if (!Usable("sum to", {&x})) return Invalid({&x});
  if (x.shape() == shape) return x;
  Shape joined;
  if (!BroadcastShape(x.shape(), shape, joined) || !(joined == x.shape()))
    return Refuse(x, "sum to: {} was not broadcast from {}", x.shape(), shape);
  AxisSet axes{};
  const int missing = x.shape().rank() - shape.rank();
  for (int axis = 0; axis < x.shape().rank(); ++axis)
    axes[static_cast<std::size_t>(axis)] =
        axis < missing || (shape[axis - missing] == 1 && x.shape()[axis] != 1);
  return Reshape(SumOver(x, axes, Keep::kYes), shape);
}

Var LogSoftmax(const Var& x, int axis) {
  const Var z = Lowered(x, axis);
  return Sub(z, Log(Sum(Exp(z), {axis}, Keep::kYes)));
}

Var Softmax(const Var& x, int axis) {
  const Var e = Exp(Lowered(x, axis));
  return Div(e, Sum(e, {axis}, Keep::kYes));
}

Var CrossEntropy(const Var& logits, const Tensor& labels) {
  if (!Usable("cross-entropy", {&logits})) return Invalid({&logits});
  const std::int64_t rows = labels.empty() ? 0 : labels.shape().elements();
  if (!AreLogits(logits, rows))
    return Refuse(logits, "cross-entropy: logits {} with {} labels", logits.shape(), rows);
  return Neg(Mean(TakeAlong(LogSoftmax(logits, 1), labels.Reshaped({rows, 1}))));
}

}  // namespace tilegrad::nn
