// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "nn/ops.h"

namespace tilegrad::nn {
namespace {

// Rows picked along the middle axis of [outer, extent, inner].
struct IndexedRows {
  std::size_t outer = 1, extent = 1, inner = 1;
  const std::int32_t* indices = nullptr;  // [count], each in [0, extent)
  std::size_t count = 0;
};

// Elements picked along the last axis of [outer, extent], other ones for each row.
struct PickedElements {
  std::size_t outer = 1, extent = 1;
  const std::int32_t* indices = nullptr;  // [outer, count], each in [0, extent)
  std::size_t count = 0;
};

constexpr std::size_t kCopyGrain = 16384;  // elements to a task

std::size_t RowsPerTask(std::size_t length) {
  return std::max<std::size_t>(1, kCopyGrain / std::max<std::size_t>(1, length));
}

// y[o, i, :] = x[o, indices[i], :]; y is [outer, count, inner].
template <class T>
void GatherRows(const IndexedRows& rows, const T* x, T* y, const Workers& workers) {
  workers.ForEach(rows.outer * rows.count, RowsPerTask(rows.inner), [&](std::size_t row) {
    const std::size_t o = row / rows.count;
    const auto index = static_cast<std::size_t>(rows.indices[row % rows.count]);
    std::copy_n(x + (o * rows.extent + index) * rows.inner, rows.inner, y + row * rows.inner);
  });
}

// y = 0, then y[o, indices[i], :] += x[o, i, :] in the order of i; y is [outer, extent, inner].
template <class T>
void ScatterRows(const IndexedRows& rows, const T* x, T* y, const Workers& workers) {
  workers.For(rows.outer, [&](std::size_t o) {
    T* to = y + o * rows.extent * rows.inner;
    std::fill_n(to, rows.extent * rows.inner, T(0));
    for (std::size_t i = 0; i < rows.count; ++i) {
      const T* from = x + (o * rows.count + i) * rows.inner;
      T* sum = to + static_cast<std::size_t>(rows.indices[i]) * rows.inner;
      for (std::size_t k = 0; k < rows.inner; ++k) sum[k] += from[k];
    }
  });
}

// y[o, i] = x[o, indices[o, i]]; y is [outer, count].
template <class T>
void TakeElements(const PickedElements& picked, const T* x, T* y, const Workers& workers) {
  workers.ForEach(picked.outer, RowsPerTask(picked.count), [&](std::size_t o) {
    const T* row = x + o * picked.extent;
    for (std::size_t i = o * picked.count; i < (o + 1) * picked.count; ++i)
      y[i] = row[picked.indices[i]];
  });
}

// y = 0, then y[o, indices[o, i]] += x[o, i] in the order of i; y is [outer, extent].
template <class T>
void PlaceElements(const PickedElements& picked, const T* x, T* y, const Workers& workers) {
  workers.ForEach(picked.outer, RowsPerTask(picked.extent), [&](std::size_t o) {
    T* row = y + o * picked.extent;
    std::fill_n(row, picked.extent, T(0));
    for (std::size_t i = o * picked.count; i < (o + 1) * picked.count; ++i)
      row[picked.indices[i]] += x[i];
  });
}

// Why elements below `extent` cannot be addressed by `indices`, or OK.
Status CheckIndices(const char* op, const Tensor& indices, std::int64_t extent) {
  if (indices.empty() || indices.dtype() != DType::kI32)
    return InvalidArgument("{}: indices must be of I32", op);
  for (std::int32_t i : indices.span<std::int32_t>()) {
    if (i < 0 || i >= extent) return InvalidArgument("{}: index {} of {}", op, i, extent);
  }
  return {};
}

// That `indices` is [n] and picks along an axis which `shape` has.
Status CheckRows(const char* op, const Shape& shape, int axis, const Tensor& indices,
                 std::int64_t extent) {
  if (axis < 0 || axis >= shape.rank())
    return InvalidArgument("{}: axis {} of {}", op, axis, shape);
  if (indices.shape().rank() != 1) return InvalidArgument("{}: indices must be [n]", op);
  return CheckIndices(op, indices, extent);
}

IndexedRows RowsOf(const Shape& shape, int axis, const Tensor& indices) {
  return {static_cast<std::size_t>(shape.Product(0, axis)), static_cast<std::size_t>(shape[axis]),
          static_cast<std::size_t>(shape.Product(axis + 1, shape.rank())),
          indices.data<std::int32_t>(), indices.elements()};
}

PickedElements PickedOf(const Tensor& indices, std::int64_t extent) {
  const Shape& shape = indices.shape();
  return {static_cast<std::size_t>(shape.Product(0, shape.rank() - 1)),
          static_cast<std::size_t>(extent), indices.data<std::int32_t>(),
          static_cast<std::size_t>(shape[shape.rank() - 1])};
}

// That `indices` pick along the last axis of `shape`: equal rows, all indices below `extent`.
Status CheckPicks(const char* op, const Shape& shape, const Tensor& indices, std::int64_t extent) {
  TILEGRAD_TRY(CheckIndices(op, indices, extent));
  const int last = shape.rank() - 1;
  if (last >= 0 && indices.shape().rank() == shape.rank() &&
      indices.shape().With(last, 0) == shape.With(last, 0)) {
    return {};
  }
  return InvalidArgument("{}: indices {} for {}", op, indices.shape(), shape);
}

}  // namespace

Var Gather(const Var& x, int axis, const Tensor& indices) {
  if (!Usable("gather", {&x})) return Invalid({&x});
  const std::int64_t extent = axis >= 0 && axis < x.shape().rank() ? x.shape()[axis] : 0;
  if (const Status s = CheckRows("gather", x.shape(), axis, indices, extent); !s.ok())
    return Fail(x, s);
  const Shape picked = x.shape().With(axis, indices.shape()[0]);
  if (!IsPossibleResult("gather", x, picked)) return Invalid({&x});
  Tensor y = x.context().Empty(picked, x.dtype());
  WithFloatType(x.dtype(), [&]<class T>(T) {
    GatherRows(RowsOf(x.shape(), axis, indices), x.value().data<T>(), y.data<T>(),
               x.context().workers());
  });
  return Record({"gather"}, std::move(y), {x}, [axis, indices, extent](const Adjoint& adj) {
    return Vars{ScatterAdd(adj.dy(), axis, indices, extent)};
  });
}

Var ScatterAdd(const Var& x, int axis, const Tensor& indices, std::int64_t extent) {
  if (!Usable("scatter", {&x})) return Invalid({&x});
  if (const Status s = CheckRows("scatter", x.shape(), axis, indices, extent); !s.ok())
    return Fail(x, s);
  if (indices.shape()[0] != x.shape()[axis])
    return Refuse(x, "scatter: {} indices for axis {} of {}", indices.shape()[0], axis, x.shape());
  const Shape whole = x.shape().With(axis, extent);
  if (!IsPossibleResult("scatter", x, whole)) return Invalid({&x});
  Tensor y = x.context().Empty(whole, x.dtype());
  WithFloatType(x.dtype(), [&]<class T>(T) {
    ScatterRows(RowsOf(y.shape(), axis, indices), x.value().data<T>(), y.data<T>(),
                x.context().workers());
  });
  return Record({"scatter"}, std::move(y), {x}, [axis, indices](const Adjoint& adj) {
    return Vars{Gather(adj.dy(), axis, indices)};
  });
}

Var TakeAlong(const Var& x, const Tensor& indices) {
  if (!Usable("take along", {&x})) return Invalid({&x});
  const std::int64_t extent = x.shape().rank() > 0 ? x.shape()[x.shape().rank() - 1] : 0;
  if (const Status s = CheckPicks("take along", x.shape(), indices, extent); !s.ok())
    return Fail(x, s);
  Tensor y = x.context().Empty(indices.shape(), x.dtype());
  WithFloatType(x.dtype(), [&]<class T>(T) {
    TakeElements(PickedOf(indices, extent), x.value().data<T>(), y.data<T>(),
                 x.context().workers());
  });
  return Record({"take along"}, std::move(y), {x}, [indices, extent](const Adjoint& adj) {
    return Vars{PlaceAlong(adj.dy(), indices, extent)};
  });
}

Var PlaceAlong(const Var& x, const Tensor& indices, std::int64_t extent) {
  if (!Usable("place along", {&x})) return Invalid({&x});
  Status status = CheckPicks("place along", x.shape(), indices, extent);
  if (status.ok() && !(indices.shape() == x.shape()))
    status = InvalidArgument("place along: {} indices for {}", indices.shape(), x.shape());
  if (!status.ok()) return Fail(x, status);
  const Shape whole = x.shape().With(x.shape().rank() - 1, extent);
  if (!IsPossibleResult("place along", x, whole)) return Invalid({&x});
  Tensor y = x.context().Empty(whole, x.dtype());
  WithFloatType(x.dtype(), [&]<class T>(T) {
    PlaceElements(PickedOf(indices, extent), x.value().data<T>(), y.data<T>(),
                  x.context().workers());
  });
  return Record({"place along"}, std::move(y), {x},
                [indices](const Adjoint& adj) { return Vars{TakeAlong(adj.dy(), indices)}; });
}

}  // namespace tilegrad::nn
