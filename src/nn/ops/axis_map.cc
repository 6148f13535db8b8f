// SPDX-License-Identifier: Apache-2.0

#include "nn/kernels/axis_map.h"

#include <algorithm>
#include <utility>

#include "nn/ops.h"

namespace tilegrad::nn {
namespace {

AxisMap Allocate(Context& context, DType dtype, const AxisExtents& extents, std::int64_t terms) {
  return {extents.in,
          extents.out,
          context.Empty({extents.out + 1}, DType::kI32),
          context.Empty({terms}, DType::kI32),
          context.Empty({terms}, dtype),
          std::allocate_shared<AxisMap>(context.allocator<AxisMap>())};
}

// A counting sort of the terms by column keeps the rows of each column in order.
AxisMap Transposed(Context& context, const AxisMap& map) {
  const DType dtype = map.weight.dtype();
  AxisMap result = Allocate(context, dtype, {map.out, map.in}, map.index.shape()[0]);
  const auto begin = result.begin.span<std::int32_t>();
  std::fill(begin.begin(), begin.end(), 0);
  const auto columns = std::as_const(map.index).span<std::int32_t>();
  for (const std::int32_t column : columns) ++begin[static_cast<std::size_t>(column) + 1];
  for (std::size_t i = 1; i < begin.size(); ++i) begin[i] += begin[i - 1];
  StepVector<std::int32_t> next(begin.begin(), begin.end() - 1, context.allocator<std::int32_t>());
  const auto* rows = map.begin.data<std::int32_t>();
  WithFloatType(dtype, [&]<class T>(T) {
    for (std::int32_t i = 0; i < map.out; ++i) {
      for (std::int32_t t = rows[i]; t < rows[i + 1]; ++t) {
        const std::int32_t place =
            next[static_cast<std::size_t>(columns[static_cast<std::size_t>(t)])]++;
        result.index.data<std::int32_t>()[place] = i;
        result.weight.data<T>()[place] = map.weight.data<T>()[t];
      }
    }
  });
  return result;
}

const AxisMap& TransposedOnce(Context& context, const AxisMap& map) {
  if (map.transposed->weight.empty()) *map.transposed = Transposed(context, map);
  return *map.transposed;
}

template <class T>
SparseRows<T> RowsOf(const AxisMap& map) {
  return {static_cast<std::size_t>(map.in), static_cast<std::size_t>(map.out),
          map.begin.data<std::int32_t>(), map.index.data<std::int32_t>(), map.weight.data<T>()};
}

// The element of [0, extent) that stands at position i, which may lie outside.
std::int64_t SourceOf(std::int64_t i, std::int64_t extent, PadMode mode) {
  if (mode == PadMode::kCircular) return ((i % extent) + extent) % extent;
  return std::clamp<std::int64_t>(i, 0, extent - 1);
}

// Padding of one axis.
struct AxisPadding {
  std::int64_t extent, before, after;
  PadMode mode;
  bool IsPossible() const {
    const std::int64_t most = std::max(before, after);
    return extent > 0 && before >= 0 && after >= 0 && most <= AxisMap::kMostExtent &&
           before + extent + after <= AxisMap::kMostExtent;
  }
  AxisMap Map(const Var& like) const {
    const auto row = [&](std::int64_t i, AxisTerms& terms) {
      const std::int64_t at = i - before;
      if (mode == PadMode::kZero && (at < 0 || at >= extent)) return;
      terms.push_back({SourceOf(at, extent, mode), 1.0});
    };
    return MakeAxisMap(like, {extent, before + extent + after}, row);
  }
};

Var RefusedPadding(const Var& x, const AxisPadding& padding, int axis) {
  return Refuse(x, "pad: {} and {} along axis {} of {} in this mode", padding.before, padding.after,
                axis, x.shape());
}

void AppendBilinear(const AxisExtents& e, std::int64_t i, AxisTerms& terms) {
  const double scale = static_cast<double>(e.in) / static_cast<double>(e.out);
  const double at = std::max(0.0, (static_cast<double>(i) + 0.5) * scale - 0.5);
  const auto below = std::min(e.in - 1, static_cast<std::int64_t>(at));
  const double share = below == e.in - 1 ? 0.0 : at - static_cast<double>(below);
  terms.push_back({below, 1.0 - share});
  if (share > 0) terms.push_back({below + 1, share});
}

AxisMap ResizedAxis(const Var& x, int axis, std::int64_t extent, ResizeMode mode) {
  const AxisExtents extents{x.shape()[axis], extent};
  return MakeAxisMap(x, extents, [&](std::int64_t i, AxisTerms& terms) {
    if (mode == ResizeMode::kBilinear) return AppendBilinear(extents, i, terms);
    terms.push_back({i * extents.in / extents.out, 1.0});
  });
}

}  // namespace

AxisMap MakeAxisMap(const Var& like, const AxisExtents& extents,
                    FunctionRef<void(std::int64_t i, AxisTerms& terms)> row) {
  Context& context = like.context();
  AxisTerms terms(context.allocator<AxisTerm>());
  StepVector<std::int32_t> ends({0}, context.allocator<std::int32_t>());
  for (std::int64_t i = 0; i < extents.out; ++i) {
    row(i, terms);
    ends.push_back(static_cast<std::int32_t>(terms.size()));
  }
  AxisMap map = Allocate(context, like.dtype(), extents, static_cast<std::int64_t>(terms.size()));
  std::copy(ends.begin(), ends.end(), map.begin.data<std::int32_t>());
  WithFloatType(like.dtype(), [&]<class T>(T) {
    for (std::size_t t = 0; t < terms.size(); ++t) {
      map.index.data<std::int32_t>()[t] = static_cast<std::int32_t>(terms[t].index);
      map.weight.data<T>()[t] = static_cast<T>(terms[t].weight);
    }
  });
  return map;
}

Var MapAxis(const Var& x, int axis, const AxisMap& map) {
  if (!Usable("map axis", {&x})) return Invalid({&x});
  Shape shape = x.shape();
  if (axis < 0 || axis >= shape.rank() || shape[axis] != map.in ||
      map.weight.dtype() != x.dtype()) {
    return Refuse(x, "map axis: a map from {} along axis {} of {}", map.in, axis, shape);
  }
  shape[axis] = map.out;
  Tensor y = x.context().Empty(shape, x.dtype());
  const auto size = [](std::int64_t extent) { return static_cast<std::size_t>(extent); };
  WithFloatType(x.dtype(), [&]<class T>(T) {
    MapAxis(
        AxisMapProblem<T>{size(shape.Product(0, axis)), size(shape.Product(axis + 1, shape.rank())),
                          RowsOf<T>(map), x.value().data<T>(), y.data<T>()},
        x.context().workers());
  });
  return Record({"map axis"}, std::move(y), {x}, [axis, map](const Adjoint& adj) {
    return Vars{MapAxis(adj.dy(), axis, TransposedOnce(adj.dy().context(), map))};
  });
}

Var MapImage(const Var& x, const AxisMap& rows, const AxisMap& columns) {
  if (!Usable("map image", {&x})) return Invalid({&x});
  Shape shape = x.shape();
  if (shape.rank() != 4 || shape[2] != rows.in || shape[3] != columns.in ||
      rows.weight.dtype() != x.dtype() || columns.weight.dtype() != x.dtype()) {
    return Refuse(x, "map image: a map from {} x {} of {}", rows.in, columns.in, shape);
  }
  shape[2] = rows.out;
  shape[3] = columns.out;
  if (!IsPossibleResult("map image", x, shape)) return Invalid({&x});
  Context& context = x.context();
  Tensor y = context.Empty(shape, x.dtype());
  WithFloatType(x.dtype(), [&]<class T>(T) {
    MapImage(ImageMapProblem<T>{static_cast<std::size_t>(shape[0] * shape[1]), RowsOf<T>(rows),
                                RowsOf<T>(columns), x.value().data<T>(), y.data<T>()},
             context.kernels());
  });
  return Record({"map image"}, std::move(y), {x}, [rows, columns](const Adjoint& adj) {
    Context& of = adj.dy().context();
    return Vars{MapImage(adj.dy(), TransposedOnce(of, rows), TransposedOnce(of, columns))};
  });
}

Var Pad(const Var& x, int axis, std::int64_t before, std::int64_t after, PadMode mode) {
  if (!Usable("pad", {&x})) return Invalid({&x});
  if (mode == PadMode::kZero) return Pad(x, axis, before, after);
  const std::int64_t extent = axis >= 0 && axis < x.shape().rank() ? x.shape()[axis] : 0;
  const AxisPadding padding{extent, before, after, mode};
  if (!padding.IsPossible()) return RefusedPadding(x, padding, axis);
  if (before == 0 && after == 0) return x;
  if (!IsPossibleResult("pad", x, x.shape().With(axis, before + extent + after)))
    return Invalid({&x});
  return MapAxis(x, axis, padding.Map(x));
}

Var PadImage(const Var& x, const Padding& padding, const PadModes& modes) {
  if (!Usable("pad image", {&x})) return Invalid({&x});
  if (x.shape().rank() != 4) return Refuse(x, "pad image: {} is not [n, c, h, w]", x.shape());
  const AxisPadding rows{x.shape()[2], padding.top, padding.bottom, modes.vertical};
  const AxisPadding columns{x.shape()[3], padding.left, padding.right, modes.horizontal};
  if (!rows.IsPossible()) return RefusedPadding(x, rows, 2);
  if (!columns.IsPossible()) return RefusedPadding(x, columns, 3);
  const Shape padded = {x.shape()[0], x.shape()[1], rows.before + rows.extent + rows.after,
                        columns.before + columns.extent + columns.after};
  if (!IsPossibleResult("pad image", x, padded)) return Invalid({&x});
  return MapImage(x, rows.Map(x), columns.Map(x));
}

Var Resize(const Var& x, ImageSize size, ResizeMode mode) {
  if (!Usable("resize", {&x})) return Invalid({&x});
  const bool image = x.shape().rank() == 4 && x.shape()[2] > 0 && x.shape()[3] > 0;
  const bool fits = size.height >= 1 && size.height <= AxisMap::kMostExtent && size.width >= 1 &&
                    size.width <= AxisMap::kMostExtent;
  if (!image || !fits)
    return Refuse(x, "resize: {} to {} x {}", x.shape(), size.height, size.width);
  if (!IsPossibleResult("resize", x, {x.shape()[0], x.shape()[1], size.height, size.width}))
    return Invalid({&x});
  if (x.shape()[2] == size.height && x.shape()[3] == size.width) return x;
  return MapImage(x, ResizedAxis(x, 2, size.height, mode), ResizedAxis(x, 3, size.width, mode));
}

}  // namespace tilegrad::nn
