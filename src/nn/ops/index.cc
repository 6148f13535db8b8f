// SPDX-License-Identifier: Apache-2.0
#include "nn/ops/index.h"

#include <utility>

#include "base/error.h"
#include "nn/kernels/copy.h"

namespace tilegrad::nn {
namespace {

// Why elements below `extent` cannot be addressed by `indices`, or OK.
Status CheckIndices(const char* op, const Tensor& indices, std::int64_t extent) {
  if (indices.empty() || indices.dtype() != DType::kI32) {
    return InvalidArgument("{}: indices must be of I32", op);
  }
  for (std::int32_t i : indices.span<std::int32_t>()) {
    if (i < 0 || i >= extent) return InvalidArgument("{}: index {} of {}", op, i, extent);
  }
  return {};
}

// That `indices` is [n] and picks along an axis which `shape` has.
Status CheckRows(const char* op, const Shape& shape, int axis, const Tensor& indices,
                 std::int64_t extent) {
  if (axis < 0 || axis >= shape.rank()) {
    return InvalidArgument("{}: axis {} of {}", op, axis, shape.ToString());
  }
  if (indices.shape().rank() != 1) return InvalidArgument("{}: indices must be [n]", op);
  return CheckIndices(op, indices, extent);
}

IndexedRows RowsOf(const Shape& shape, int axis, const Tensor& indices) {
  return {static_cast<std::size_t>(shape.Product(0, axis)), static_cast<std::size_t>(shape[axis]),
          static_cast<std::size_t>(shape.Product(axis + 1, shape.rank())),
          indices.data<std::int32_t>(), indices.elements()};
}

}  // namespace

Var Gather(const Var& x, int axis, const Tensor& indices) {
  if (!Usable("gather", {&x})) return Invalid({&x});
  const std::int64_t extent = axis >= 0 && axis < x.shape().rank() ? x.shape()[axis] : 0;
  if (const Status s = CheckRows("gather", x.shape(), axis, indices, extent); !s.ok()) {
    return Fail(x, s);
  }
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
  if (const Status s = CheckRows("scatter", x.shape(), axis, indices, extent); !s.ok()) {
    return Fail(x, s);
  }
  if (indices.shape()[0] != x.shape()[axis]) {
    return Fail(x, InvalidArgument("scatter: {} indices for axis {} of {}", indices.shape()[0],
                                   axis, x.shape().ToString()));
  }
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

namespace {

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
  return InvalidArgument("{}: indices {} for {}", op, indices.shape().ToString(), shape.ToString());
}

}  // namespace

Var TakeAlong(const Var& x, const Tensor& indices) {
  if (!Usable("take along", {&x})) return Invalid({&x});
  const std::int64_t extent = x.shape().rank() > 0 ? x.shape()[x.shape().rank() - 1] : 0;
  if (const Status s = CheckPicks("take along", x.shape(), indices, extent); !s.ok()) {
    return Fail(x, s);
  }
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
  if (status.ok() && !(indices.shape() == x.shape())) {
    status = InvalidArgument("place along: {} indices for {}", indices.shape().ToString(),
                             x.shape().ToString());
  }
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
