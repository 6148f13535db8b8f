// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "base/error.h"
#include "base/parallel.h"
#include "nn/ops.h"

namespace tilegrad::nn {
namespace {

// Where the largest element of each window of an image lies. Nothing is computed, and a window's
// few elements lie in few cache lines, so there is no vector body.

struct PoolShape {
  std::size_t planes = 1, height = 1, width = 1;  // x: [planes, height, width]
  std::size_t out_height = 1, out_width = 1;      // first: [planes, out_height, out_width]
  std::size_t kernel = 1, stride = 1, padding = 0;
};

struct Range {
  std::size_t begin, end;
};

// The part of an axis of `extent` elements that window i covers.
Range Window(const PoolShape& s, std::size_t i, std::size_t extent) {
  const std::size_t from = i * s.stride;  // in the padded axis
  return {from > s.padding ? from - s.padding : 0, std::min(extent, from + s.kernel - s.padding)};
}

template <class T>
std::int32_t Largest(const PoolShape& s, const T* x, const Range& rows, const Range& columns) {
  std::size_t best = rows.begin * s.width + columns.begin;
  for (std::size_t r = rows.begin; r < rows.end; ++r) {
    for (std::size_t k = r * s.width + columns.begin; k < r * s.width + columns.end; ++k) {
      if (x[k] > x[best] || (x[k] != x[k] && x[best] == x[best])) best = k;
    }
  }
  return static_cast<std::int32_t>(best);
}

// first[p, i, j] = the index in plane p of the first element that attains the maximum over rows
// i stride - padding + [0, kernel) and columns alike, as far as they are in the image; some are,
// for every window. NaN counts as larger than everything.
template <class T>
void MaxPoolIndices(const PoolShape& s, const T* x, std::int32_t* first, const Workers& workers) {
  workers.For(s.planes * s.out_height, [&](std::size_t row, std::size_t) {
    const T* plane = x + row / s.out_height * s.height * s.width;
    const Range rows = Window(s, row % s.out_height, s.height);
    for (std::size_t j = 0; j < s.out_width; ++j) {
      first[row * s.out_width + j] = Largest(s, plane, rows, Window(s, j, s.width));
    }
  });
}

std::int64_t Windows(std::int64_t extent, const PoolOptions& o) {
  return (extent + 2 * static_cast<std::int64_t>(o.padding) - o.kernel) / o.stride + 1;
}

Status Check(const char* op, const Shape& x, const PoolOptions& o) {
  const bool options =
      o.kernel >= 1 && o.stride >= 1 && o.padding >= 0 && o.padding <= o.kernel / 2;
  const std::int64_t padding = 2 * static_cast<std::int64_t>(o.padding);
  if (options && x.rank() == 4 && x[2] > 0 && x[3] > 0 && x[2] + padding >= o.kernel &&
      x[3] + padding >= o.kernel && x.Product(2, 4) <= std::numeric_limits<std::int32_t>::max()) {
    return {};
  }
  return InvalidArgument("{}: input {}, kernel {}, stride {}, padding {}", op, x.ToString(),
                         o.kernel, o.stride, o.padding);
}

Var MeanAlong(const Var& x, int axis, const PoolOptions& o) {
  const AxisExtents extents{x.shape()[axis], Windows(x.shape()[axis], o)};
  const auto row = [&](std::int64_t i, AxisTerms& terms) {
    const std::int64_t begin = i * o.stride - o.padding;
    const std::int64_t end = std::min(extents.in, begin + o.kernel);
    for (std::int64_t at = std::max<std::int64_t>(0, begin); at < end; ++at) {
      terms.push_back({at, 1.0 / o.kernel});
    }
  };
  return MapAxis(x, axis, MakeAxisMap(x, extents, row));
}

}  // namespace

Var AvgPool2d(const Var& x, const PoolOptions& options) {
  if (!Usable("average pooling", {&x})) return Invalid({&x});
  if (const Status s = Check("average pooling", x.shape(), options); !s.ok()) return Fail(x, s);
  return MeanAlong(MeanAlong(x, 2, options), 3, options);
}

// The elements are picked by index; picking is linear, and its adjoint puts them back.
Var MaxPool2d(const Var& x, const PoolOptions& options) {
  if (!Usable("max pooling", {&x})) return Invalid({&x});
  if (const Status s = Check("max pooling", x.shape(), options); !s.ok()) {
    return Fail(x, s);
  }
  const Shape& in = x.shape();
  const Shape out = {in[0], in[1], Windows(in[2], options), Windows(in[3], options)};
  const auto size = [](std::int64_t extent) { return static_cast<std::size_t>(extent); };
  const PoolShape shape{size(in[0] * in[1]),  size(in[2]),          size(in[3]),
                        size(out[2]),         size(out[3]),         size(options.kernel),
                        size(options.stride), size(options.padding)};
  Context& context = x.context();
  Tensor first = context.Empty({in[0] * in[1], out[2] * out[3]}, DType::kI32);
  WithFloatType(x.dtype(), [&]<class T>(T) {
    MaxPoolIndices(shape, x.value().data<T>(), first.data<std::int32_t>(), context.workers());
  });
  return Reshape(TakeAlong(Reshape(x, {in[0] * in[1], in[2] * in[3]}), first), out);
}

}  // namespace tilegrad::nn
