// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <utility>

#include "base/parallel.h"
#include "nn/kernels/panels.h"
#include "nn/ops.h"
#include "nn/ops/broadcast.h"

namespace tilegrad::nn {
namespace {

// to[sum i strides_to] = from[sum i strides_from] for every index of a box. Axes that are not used
// have extent 1.
struct StridedBox {
  static constexpr int kRank = 5;
  using Axes = std::array<std::size_t, kRank>;
  Axes extents = {1, 1, 1, 1, 1};
  Axes strides_from{}, strides_to{};
};

template <class T>
struct Copied {
  void operator()(const T& from, T& to) const { to = from; }
};

template <class T>
struct Added {
  void operator()(const T& from, T& to) const { to += from; }
};

// Calls op(from, to) for the elements [begin, end) of a row.
template <class Op, class T>
void MoveRow(const StridedBox& box, std::size_t begin, std::size_t end, const T* from, T* to) {
  const Op op;
  const std::size_t step_from = box.strides_from.back(), step_to = box.strides_to.back();
  if (step_from == 1 && step_to == 1) {
    for (std::size_t i = begin; i < end; ++i) op(from[i], to[i]);
    return;
  }
  for (std::size_t i = begin; i < end; ++i) op(from[i * step_from], to[i * step_to]);
}

// Where a row of a box starts. Divides for the first row only: rows may be as short as a colour.
class RowStart {
 public:
  RowStart(const StridedBox& box, std::size_t row) : box_(box) {
    for (std::size_t i = kAxes; i-- > 0;) {
      index_[i] = row % box.extents[i];
      row /= box.extents[i];
      Step(i, index_[i]);
    }
  }
  std::size_t from() const { return from_; }
  std::size_t to() const { return to_; }
  void Next() {
    for (std::size_t i = kAxes; i-- > 0;) {
      Step(i, 1);
      if (++index_[i] < box_.extents[i]) return;
      Step(i, 0 - index_[i]);
      index_[i] = 0;
    }
  }

 private:
  static constexpr std::size_t kAxes = StridedBox::kRank - 1;
  void Step(std::size_t axis, std::size_t by) {
    from_ += by * box_.strides_from[axis];
    to_ += by * box_.strides_to[axis];
  }

  const StridedBox& box_;
  std::array<std::size_t, kAxes> index_{};
  std::size_t from_ = 0, to_ = 0;
};

// Calls op(from, to) for all elements. Long rows are cut, so that one is more than one task.
template <class Op, class T>
void MoveStrided(const StridedBox& box, const T* from, T* to, const Workers& workers) {
  std::size_t rows = 1;
  for (std::size_t i = 0; i + 1 < box.extents.size(); ++i) rows *= box.extents[i];
  const std::size_t length = std::max<std::size_t>(1, box.extents.back());
  const std::size_t grain = GrainFor(rows * length, 16384, workers);  // elements
  const std::size_t pieces = (length + grain - 1) / grain;
  workers.ForRanges(rows * pieces, std::max<std::size_t>(1, grain / length),
                    [&](std::size_t begin, std::size_t end) {
                      RowStart row(box, begin / pieces);
                      std::size_t piece = begin % pieces;
                      for (std::size_t i = begin; i < end; ++i) {
                        MoveRow<Op>(box, piece * grain,
                                    std::min(box.extents.back(), (piece + 1) * grain),
                                    from + row.from(), to + row.to());
                        if (++piece < pieces) continue;
                        piece = 0;
                        row.Next();
                      }
                    });
}

// Row-major strides, right-aligned into a box of five axes.
StridedBox::Axes StridesOf(const Shape& shape) {
  StridedBox::Axes strides{};
  std::size_t stride = 1;
  for (int axis = shape.rank() - 1; axis >= 0; --axis) {
    strides[static_cast<std::size_t>(StridedBox::kRank - shape.rank() + axis)] = stride;
    stride *= static_cast<std::size_t>(shape[axis]);
  }
  return strides;
}

StridedBox::Axes ExtentsOf(const Shape& shape) {
  StridedBox::Axes extents = {1, 1, 1, 1, 1};
  for (int axis = 0; axis < shape.rank(); ++axis)
    extents[static_cast<std::size_t>(StridedBox::kRank - shape.rank() + axis)] =
        static_cast<std::size_t>(shape[axis]);
  return extents;
}

template <template <class> class Op = Copied>
void Move(const StridedBox& box, const Var& x, std::size_t from, Tensor& y, std::size_t to) {
  WithFloatType(x.dtype(), [&]<class T>(T) {
    MoveStrided<Op<T>>(box, x.value().data<T>() + from, y.data<T>() + to, x.context().workers());
  });
}

bool HasAxis(const Shape& shape, int axis) { return axis >= 0 && axis < shape.rank(); }

// [outer, extent of axis, inner]
struct AxisView {
  AxisView(const Shape& shape, int axis)
      : outer(static_cast<std::size_t>(shape.Product(0, axis))),
        extent(static_cast<std::size_t>(shape[axis])),
        inner(static_cast<std::size_t>(shape.Product(axis + 1, shape.rank()))) {}
  std::size_t outer, extent, inner;
};

// Copies (or adds) `count` rows along an axis, from row `begin_x` of x to row `begin_y` of y.
struct RowMove {
  int axis;
  std::size_t begin_x, begin_y, count;
};

template <template <class> class Op = Copied>
void MoveRows(const RowMove& move, const Var& x, Tensor& y) {
  const AxisView vx(x.shape(), move.axis), vy(y.shape(), move.axis);
  StridedBox box;
  box.extents = {1, 1, 1, vx.outer, move.count * vx.inner};
  box.strides_from = {0, 0, 0, vx.extent * vx.inner, 1};
  box.strides_to = {0, 0, 0, vy.extent * vy.inner, 1};
  Move<Op>(box, x, move.begin_x * vx.inner, y, move.begin_y * vy.inner);
}

bool IsPadding(std::int64_t count) { return count >= 0 && count <= Shape::kMostElements; }

// Joining two at a time would copy the first parts repeatedly; this copies each part once.
Var ConcatChecked(std::span<const Var> parts, int axis, std::int64_t extent) {
  Context& context = parts[0].context();
  Tensor y = context.Empty(parts[0].shape().With(axis, extent), parts[0].dtype());
  InlineVector<std::int64_t, 8> ends = {0};
  for (const Var& part : parts) {
    const std::int64_t count = part.shape()[axis];
    MoveRows({axis, 0, static_cast<std::size_t>(ends.back()), static_cast<std::size_t>(count)},
             part, y);
    ends.push_back(ends.back() + count);
  }
  const auto rule = [axis, ends](const Adjoint& adj) {
    Vars d(ends.size() - 1);
    for (std::size_t i = 0; i < d.size(); ++i) {
      if (adj.needs(i)) d[i] = Slice(adj.dy(), axis, ends[i], ends[i + 1]);
    }
    return d;
  };
  return Record({"concat"}, std::move(y), parts, rule);
}

}  // namespace

Var Reshape(const Var& x, Shape shape) {
  if (!Usable("reshape", {&x})) return Invalid({&x});
  if (x.shape() == shape) return x;
  const Shape asked = shape;
  int open = -1;
  for (int axis = 0; axis < shape.rank(); ++axis) {
    if (shape[axis] == -1 && open < 0) open = axis;
  }
  if (open >= 0) shape[open] = 1;
  if (open >= 0 && shape.IsPossible()) {
    const std::int64_t rest = std::max<std::int64_t>(1, shape.elements());
    shape[open] = x.shape().elements() / rest;
  }
  if (!shape.IsPossible() || shape.elements() != x.shape().elements())
    return Refuse(x, "reshape: {} to {}", x.shape(), asked);
  return Record(
      {"reshape"}, x.value().Reshaped(shape), {x},
      [before = x.shape()](const Adjoint& adj) { return Vars{Reshape(adj.dy(), before)}; });
}

Var BroadcastTo(const Var& x, const Shape& shape) {
  if (!Usable("broadcast", {&x})) return Invalid({&x});
  if (x.shape() == shape) return x;
  if (!IsPossibleResult("broadcast", x, shape)) return Invalid({&x});
  Shape joined;
  if (!BroadcastShape(x.shape(), shape, joined) || !(joined == shape))
    return Refuse(x, "broadcast: {} to {}", x.shape(), shape);
  const Broadcast plan = PlanBroadcast(shape, x.shape(), shape);
  Tensor y = x.context().Empty(shape, x.dtype());
  Move({plan.extents, plan.strides[0], plan.strides[1]}, x, 0, y, 0);
  return Record({"broadcast"}, std::move(y), {x},
                [before = x.shape()](const Adjoint& adj) { return Vars{SumTo(adj.dy(), before)}; });
}

Var Permute(const Var& x, std::span<const int> axes) {
  if (!Usable("permute", {&x})) return Invalid({&x});
  const int rank = x.shape().rank();
  std::array<int, Shape::kMaxRank> inverse;
  inverse.fill(-1);
  for (std::size_t i = 0; i < axes.size(); ++i) {
    if (HasAxis(x.shape(), axes[i]))
      inverse[static_cast<std::size_t>(axes[i])] = static_cast<int>(i);
  }
  const auto known = std::count_if(inverse.begin(), inverse.end(), [](int i) { return i >= 0; });
  if (static_cast<int>(axes.size()) != rank || known != rank)
    return Refuse(x, "permute: shape {} needs each of its axes once", x.shape());
  Shape shape;
  for (int axis : axes) shape.Append(x.shape()[axis]);
  StridedBox box{ExtentsOf(shape), {}, StridesOf(shape)};
  const StridedBox::Axes strides = StridesOf(x.shape());
  const auto pad = static_cast<std::size_t>(StridedBox::kRank - rank);
  for (std::size_t i = 0; i < axes.size(); ++i)
    box.strides_from[pad + i] = strides[pad + static_cast<std::size_t>(axes[i])];
  Tensor y = x.context().Empty(shape, x.dtype());
  Move(box, x, 0, y, 0);
  return Record({"permute"}, std::move(y), {x}, [inverse, rank](const Adjoint& adj) {
    const std::span<const int> back(inverse.data(), static_cast<std::size_t>(rank));
    return Vars{Permute(adj.dy(), back)};
  });
}

Var Permute(const Var& x, std::initializer_list<int> axes) {
  return Permute(x, std::span<const int>(axes.begin(), axes.size()));
}

Var Transpose(const Var& x) { return Permute(x, {1, 0}); }

Var Slice(const Var& x, int axis, std::int64_t begin, std::int64_t end) {
  if (!Usable("slice", {&x})) return Invalid({&x});
  if (!HasAxis(x.shape(), axis) || begin < 0 || begin > end || end > x.shape()[axis])
    return Refuse(x, "slice: [{}, {}) of axis {} of {}", begin, end, axis, x.shape());
  Tensor y = x.context().Empty(x.shape().With(axis, end - begin), x.dtype());
  const auto first = static_cast<std::size_t>(begin), count = static_cast<std::size_t>(end - begin);
  MoveRows({axis, first, 0, count}, x, y);
  const std::int64_t after = x.shape()[axis] - end;
  return Record({"slice"}, std::move(y), {x}, [axis, begin, after](const Adjoint& adj) {
    return Vars{adj.Part(0, {adj.dy(), axis, begin, after})};
  });
}

Var Accumulated(Var sum, const AdjointPart& part) {
  if (!IsExpendable(sum)) return Add(sum, Pad(part.value, part.axis, part.before, part.after));
  const auto begin = static_cast<std::size_t>(part.before);
  const auto count = static_cast<std::size_t>(part.value.shape()[part.axis]);
  MoveRows<Added>({part.axis, 0, begin, count}, part.value, sum.value());
  return sum;
}

Var Pad(const Var& x, int axis, std::int64_t before, std::int64_t after) {
  if (!Usable("pad", {&x})) return Invalid({&x});
  if (!HasAxis(x.shape(), axis) || !IsPadding(before) || !IsPadding(after))
    return Refuse(x, "pad: {} and {} along axis {} of {}", before, after, axis, x.shape());
  const std::int64_t extent = x.shape()[axis];
  const Shape padded = x.shape().With(axis, before + extent + after);
  if (!IsPossibleResult("pad", x, padded)) return Invalid({&x});
  Tensor y = x.context().Zeros(padded, x.dtype());
  MoveRows({axis, 0, static_cast<std::size_t>(before), static_cast<std::size_t>(extent)}, x, y);
  return Record({"pad"}, std::move(y), {x}, [axis, before, extent](const Adjoint& adj) {
    return Vars{Slice(adj.dy(), axis, before, before + extent)};
  });
}

Var Concat(std::span<const Var> parts, int axis) {
  if (parts.empty()) return {};
  const Shape& first = parts[0].shape();
  std::int64_t extent = 0;
  for (const Var& part : parts) {
    if (!Usable("concat", {&parts[0], &part})) return Invalid({&parts[0], &part});
    if (!HasAxis(first, axis) || part.shape().rank() != first.rank() ||
        !(part.shape().With(axis, 0) == first.With(axis, 0))) {
      return Refuse(part, "concat: {} and {} along axis {}", first, part.shape(), axis);
    }
    extent += part.shape()[axis];
  }
  return ConcatChecked(parts, axis, extent);
}

Var Concat(std::initializer_list<Var> parts, int axis) {
  return Concat(std::span<const Var>(parts.begin(), parts.size()), axis);
}

}  // namespace tilegrad::nn
