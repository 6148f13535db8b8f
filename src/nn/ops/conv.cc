// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "nn/kernels/conv2d/conv2d.h"
#include "nn/kernels/conv2d/conv2d_ref.h"
#include "nn/ops.h"

namespace tilegrad::nn {
namespace {

struct Extents {
  Shape x, weight;
};

Shape OutputShape(const Conv2dShape& s) {
  const auto extent = [](std::size_t size) { return static_cast<std::int64_t>(size); };
  return {extent(s.batch), extent(s.out_channels), extent(s.out_height()), extent(s.out_width())};
}

// The image with its padding, which every other size here is below.
Shape PaddedShape(const Shape& x, std::int64_t padding) {
  return {x[0], x[1], x[2] + 2 * padding, x[3] + 2 * padding};
}

Result<Conv2dShape> MakeShape(const Extents& e, const ConvOptions& options) {
  const bool images = e.x.rank() == 4 && e.weight.rank() == 4 && e.x[1] == e.weight[1];
  if (!images || options.stride < 1 || options.padding < 0)
    return InvalidArgument("conv2d: input {} with weight {}, stride {}, padding {}", e.x, e.weight,
                           options.stride, options.padding);
  // The caller may request an image of any size.
  if (!e.x.IsPossible() || !e.weight.IsPossible() ||
      !PaddedShape(e.x, options.padding).IsPossible()) {
    return InvalidArgument(
        "conv2d: input {} with weight {}, padding {}: the output is too large for a tensor", e.x,
        e.weight, options.padding);
  }
  const auto size = [](std::int64_t extent) { return static_cast<std::size_t>(extent); };
  if (options.padding_mode != PadMode::kZero && options.padding > 0)
    return InvalidArgument("conv2d: this operation pads with zeros only");
  Conv2dShape s;
  s.batch = size(e.x[0]);
  s.in_channels = size(e.x[1]);
  s.in_height = size(e.x[2]);
  s.in_width = size(e.x[3]);
  s.out_channels = size(e.weight[0]);
  s.kernel_height = size(e.weight[2]);
  s.kernel_width = size(e.weight[3]);
  s.padding = static_cast<std::size_t>(options.padding);
  // A step beyond the padded image leaves one pixel, like any longer one; the kernels' tables grow
  // with the square of the stride.
  const Shape padded = PaddedShape(e.x, options.padding);
  s.stride = size(
      std::min<std::int64_t>(options.stride, std::max({padded[2], padded[3], std::int64_t{1}})));
  TILEGRAD_TRY(s.Check());
  if (OutputShape(s).IsPossible()) return s;
  return InvalidArgument("conv2d: input {} with weight {} would give {}", e.x, e.weight,
                         OutputShape(s));
}

// That dy is of the output's shape.
Result<Conv2dShape> MakeShape(const Extents& e, const Shape& dy, const ConvOptions& options) {
  TILEGRAD_ASSIGN(const Conv2dShape s, MakeShape(e, options));
  if (dy == OutputShape(s)) return s;
  return InvalidArgument("conv2d gradient: dy {} where {} gives {}", dy, e.x, OutputShape(s));
}

ImageSize SizeOf(const Var& image) { return {image.shape()[2], image.shape()[3]}; }

// The kernels of the dtype: float on vectors, double by the reference.
struct Kernels {
  const Conv2dShape& s;
  KernelContext context;

  void Forward(const float* x, const float* w, const float* bias, float* y) const {
    Conv2dForward(s, x, w, bias, y, context);
  }
  void Forward(const double* x, const double* w, const double* bias, double* y) const {
    Conv2dForwardRef(s, x, w, bias, y);
  }
  void InputGrad(const float* dy, const float* w, float* dx) const {
    Conv2dInputGrad(s, dy, w, dx, context);
  }
  void InputGrad(const double* dy, const double* w, double* dx) const {
    Conv2dInputGradRef(s, dy, w, dx);
  }
  void WeightGrad(const float* x, const float* dy, float* dw) const {
    Conv2dWeightGrad(s, x, dy, dw, context);
  }
  void WeightGrad(const double* x, const double* dy, double* dw) const {
    Conv2dWeightGradRef(s, x, dy, dw);
  }
};

// The position of the largest element in each window of an image. There is no arithmetic, and a
// window's few elements lie in few cache lines, so there is no vector body.

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
  workers.For(s.planes * s.out_height, [&](std::size_t row) {
    const T* plane = x + row / s.out_height * s.height * s.width;
    const Range rows = Window(s, row % s.out_height, s.height);
    for (std::size_t j = 0; j < s.out_width; ++j)
      first[row * s.out_width + j] = Largest(s, plane, rows, Window(s, j, s.width));
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
  return InvalidArgument("{}: input {}, kernel {}, stride {}, padding {}", op, x, o.kernel,
                         o.stride, o.padding);
}

AxisMap MeansAlong(const Var& x, int axis, const PoolOptions& o) {
  const AxisExtents extents{x.shape()[axis], Windows(x.shape()[axis], o)};
  const auto row = [&](std::int64_t i, AxisTerms& terms) {
    const std::int64_t begin = i * o.stride - o.padding;
    const std::int64_t end = std::min(extents.in, begin + o.kernel);
    for (std::int64_t at = std::max<std::int64_t>(0, begin); at < end; ++at)
      terms.push_back({at, 1.0 / o.kernel});
  };
  return MakeAxisMap(x, extents, row);
}

}  // namespace

Var Conv2d(const Var& x, const Var& weight, const Var& bias, const ConvOptions& options) {
  const bool usable =
      bias.has_context() ? Usable("conv2d", {&x, &weight, &bias}) : Usable("conv2d", {&x, &weight});
  if (!usable) return Invalid({&x, &weight, &bias});
  if (options.padding_mode != PadMode::kZero && options.padding > 0) {
    const Padding frame = Padding::All(options.padding);
    const Var padded = PadImage(x, frame, options.padding_mode);
    return Conv2d(padded, weight, bias, {.stride = options.stride});
  }
  const auto s = MakeShape({x.shape(), weight.shape()}, options);
  if (!s.ok()) return Fail(x, s.status());
  if (bias.valid() && !(bias.shape() == Shape{weight.shape()[0]}))
    return Refuse(x, "conv2d: bias {} for weight {}", bias.shape(), weight.shape());
  Tensor y = x.context().Empty(OutputShape(*s), x.dtype());
  WithFloatType(x.dtype(), [&]<class T>(T) {
    Kernels{*s, x.context().kernels()}.Forward(x.value().data<T>(), weight.value().data<T>(),
                                               bias.valid() ? bias.value().data<T>() : nullptr,
                                               y.data<T>());
  });
  const auto rule = [x, weight, options](const Adjoint& adj) {
    const Var& dy = adj.dy();
    return Vars{adj.needs(0) ? Conv2dInputGrad(dy, weight, SizeOf(x), options) : Var(),
                adj.needs(1) ? Conv2dWeightGrad(x, dy, SizeOf(weight), options) : Var(),
                adj.needs(2) ? Sum(dy, {0, 2, 3}) : Var()};
  };
  return Record({"conv2d"}, std::move(y), {x, weight, bias}, rule);
}

Var Conv2dInputGrad(const Var& dy, const Var& weight, ImageSize size, const ConvOptions& options) {
  if (!Usable("conv2d input gradient", {&dy, &weight})) return Invalid({&dy, &weight});
  if (dy.shape().rank() != 4 || weight.shape().rank() != 4)
    return Refuse(dy, "conv2d input gradient: dy {}, weight {}", dy.shape(), weight.shape());
  const Shape shape = {dy.shape()[0], weight.shape()[1], size.height, size.width};
  const auto s = MakeShape({shape, weight.shape()}, dy.shape(), options);
  if (!s.ok()) return Fail(dy, s.status());
  Tensor dx = dy.context().Empty(shape, dy.dtype());
  WithFloatType(dy.dtype(), [&]<class T>(T) {
    Kernels{*s, dy.context().kernels()}.InputGrad(dy.value().data<T>(), weight.value().data<T>(),
                                                  dx.data<T>());
  });
  // Linear in dy and in the weight; `d` is the adjoint of dx.
  const auto rule = [dy, weight, options](const Adjoint& adj) {
    const Var& d = adj.dy();
    return Vars{adj.needs(0) ? Conv2d(d, weight, Var(), options) : Var(),
                adj.needs(1) ? Conv2dWeightGrad(d, dy, SizeOf(weight), options) : Var()};
  };
  return Record({"conv2d input gradient"}, std::move(dx), {dy, weight}, rule);
}

Var Conv2dWeightGrad(const Var& x, const Var& dy, ImageSize kernel, const ConvOptions& options) {
  if (!Usable("conv2d weight gradient", {&x, &dy})) return Invalid({&x, &dy});
  if (x.shape().rank() != 4 || dy.shape().rank() != 4)
    return Refuse(x, "conv2d weight gradient: input {}, dy {}", x.shape(), dy.shape());
  const Shape shape = {dy.shape()[1], x.shape()[1], kernel.height, kernel.width};
  const auto s = MakeShape({x.shape(), shape}, dy.shape(), options);
  if (!s.ok()) return Fail(x, s.status());
  Tensor dw = x.context().Empty(shape, x.dtype());
  WithFloatType(x.dtype(), [&]<class T>(T) {
    Kernels{*s, x.context().kernels()}.WeightGrad(x.value().data<T>(), dy.value().data<T>(),
                                                  dw.data<T>());
  });
  // Linear in x and in dy; `d` is the adjoint of dw.
  const auto rule = [x, dy, options](const Adjoint& adj) {
    const Var& d = adj.dy();
    return Vars{adj.needs(0) ? Conv2dInputGrad(dy, d, SizeOf(x), options) : Var(),
                adj.needs(1) ? Conv2d(x, d, Var(), options) : Var()};
  };
  return Record({"conv2d weight gradient"}, std::move(dw), {x, dy}, rule);
}

Var AvgPool2d(const Var& x, const PoolOptions& options) {
  if (!Usable("average pooling", {&x})) return Invalid({&x});
  if (const Status s = Check("average pooling", x.shape(), options); !s.ok()) return Fail(x, s);
  return MapImage(x, MeansAlong(x, 2, options), MeansAlong(x, 3, options));
}

// The elements are picked by index; picking is linear, and its adjoint puts them back.
Var MaxPool2d(const Var& x, const PoolOptions& options) {
  if (!Usable("max pooling", {&x})) return Invalid({&x});
  if (const Status s = Check("max pooling", x.shape(), options); !s.ok()) return Fail(x, s);
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
