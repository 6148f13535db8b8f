// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <utility>

#include "base/error.h"
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
  if (!images || options.stride < 1 || options.padding < 0) {
    return InvalidArgument("conv2d: input {} with weight {}, stride {}, padding {}", e.x.ToString(),
                           e.weight.ToString(), options.stride, options.padding);
  }
  // The caller may request an image of any size.
  if (!e.x.IsPossible() || !e.weight.IsPossible() ||
      !PaddedShape(e.x, options.padding).IsPossible()) {
    return InvalidArgument(
        "conv2d: input {} with weight {}, padding {}: the output is too large for a tensor",
        e.x.ToString(), e.weight.ToString(), options.padding);
  }
  const auto size = [](std::int64_t extent) { return static_cast<std::size_t>(extent); };
  if (options.padding_mode != PadMode::kZero && options.padding > 0) {
    return InvalidArgument("conv2d: this operation pads with zeros only");
  }
  Conv2dShape s;
  s.batch = size(e.x[0]);
  s.in_channels = size(e.x[1]);
  s.in_height = size(e.x[2]);
  s.in_width = size(e.x[3]);
  s.out_channels = size(e.weight[0]);
  s.kernel_height = size(e.weight[2]);
  s.kernel_width = size(e.weight[3]);
  s.padding = static_cast<std::size_t>(options.padding);
  // A step beyond the padded image leaves one pixel, as any longer one does; the kernels' tables
  // grow with the square of the stride.
  const Shape padded = PaddedShape(e.x, options.padding);
  s.stride = size(
      std::min<std::int64_t>(options.stride, std::max({padded[2], padded[3], std::int64_t{1}})));
  TILEGRAD_TRY(s.Check());
  if (OutputShape(s).IsPossible()) return s;
  return InvalidArgument("conv2d: input {} with weight {} would give {}", e.x.ToString(),
                         e.weight.ToString(), OutputShape(s).ToString());
}

// That dy is of the output's shape.
Result<Conv2dShape> MakeShape(const Extents& e, const Shape& dy, const ConvOptions& options) {
  TILEGRAD_ASSIGN(const Conv2dShape s, MakeShape(e, options));
  if (dy == OutputShape(s)) return s;
  return InvalidArgument("conv2d gradient: dy {} where {} gives {}", dy.ToString(), e.x.ToString(),
                         OutputShape(s).ToString());
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

}  // namespace

Var Conv2d(const Var& x, const Var& weight, const Var& bias, const ConvOptions& options) {
  const bool usable =
      bias.has_context() ? Usable("conv2d", {&x, &weight, &bias}) : Usable("conv2d", {&x, &weight});
  if (!usable) return Invalid({&x, &weight, &bias});
  if (options.padding_mode != PadMode::kZero && options.padding > 0) {
    const Var padded = PadImage(x, Padding::All(options.padding), options.padding_mode);
    return Conv2d(padded, weight, bias, {.stride = options.stride});
  }
  const auto s = MakeShape({x.shape(), weight.shape()}, options);
  if (!s.ok()) return Fail(x, s.status());
  if (bias.valid() && !(bias.shape() == Shape{weight.shape()[0]})) {
    return Fail(x, InvalidArgument("conv2d: bias {} for weight {}", bias.shape().ToString(),
                                   weight.shape().ToString()));
  }
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
  if (dy.shape().rank() != 4 || weight.shape().rank() != 4) {
    return Fail(dy, InvalidArgument("conv2d input gradient: dy {}, weight {}",
                                    dy.shape().ToString(), weight.shape().ToString()));
  }
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
  if (x.shape().rank() != 4 || dy.shape().rank() != 4) {
    return Fail(x, InvalidArgument("conv2d weight gradient: input {}, dy {}", x.shape().ToString(),
                                   dy.shape().ToString()));
  }
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

}  // namespace tilegrad::nn
