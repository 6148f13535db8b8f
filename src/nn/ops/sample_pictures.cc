// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <memory>
#include <numeric>
#include <vector>

#include "base/error.h"
#include "nn/kernels/sample_colors.h"
#include "nn/nn.h"

namespace tilegrad::nn {
namespace {

// Along one axis: the first of two pixels, the share of the second, and d share / d place.
template <class T>
struct Place {
  std::size_t low, step;  // step: to the second pixel, 0 of a picture of one pixel
  T share, slope;
};

template <class T>
Place<T> PlaceOf(T at, std::size_t extent) {
  const T pixels = static_cast<T>(extent), raw = (at + T(1)) * pixels / T(2) - T(0.5);
  const T last = pixels - T(1), cut = std::clamp(raw, T(0), last);
  if (extent == 1) return {0, 0, T(0), T(0)};
  const std::size_t low = std::min(static_cast<std::size_t>(cut), extent - 2);
  return {low, 1, cut - static_cast<T>(low), raw > T(0) && raw < last ? pixels / T(2) : T(0)};
}

struct PictureSampling {
  Tensor pictures, flow;
  std::size_t Extent(const Tensor& t, std::size_t axis) const {
    return static_cast<std::size_t>(t.shape()[static_cast<int>(axis)]);
  }
  std::size_t places() const { return Extent(flow, 2) * Extent(flow, 3); }

  // visit(picture's first channel, number of the place, x, y)
  template <class T, class Visit>
  void ForEach(std::size_t b, const Visit& visit) const {
    const std::size_t height = Extent(pictures, 2), width = Extent(pictures, 3);
    const T* const picture = pictures.span<T>().data() + b * Extent(pictures, 1) * height * width;
    const T* const at = flow.span<T>().data() + 2 * b * places();
    for (std::size_t i = 0; i < places(); ++i)
      visit(picture, i, PlaceOf(at[i], width), PlaceOf(at[places() + i], height));
  }

  template <class T>
  void Forward(std::size_t b, T* out) const {
    const std::size_t channels = Extent(pictures, 1), width = Extent(pictures, 3),
                      plane = Extent(pictures, 2) * width;
    ForEach<T>(b, [&](const T* picture, std::size_t i, const Place<T>& x, const Place<T>& y) {
      for (std::size_t c = 0; c < channels; ++c) {
        const T* const p = picture + c * plane + y.low * width + x.low;
        const T* const q = p + y.step * width;
        const T upper = p[0] + x.share * (p[x.step] - p[0]);
        const T lower = q[0] + x.share * (q[x.step] - q[0]);
        out[(b * channels + c) * places() + i] = upper + y.share * (lower - upper);
      }
    });
  }

  template <class T>
  void Backward(std::size_t b, const T* d_out, T* d_flow) const {
    const std::size_t channels = Extent(pictures, 1), width = Extent(pictures, 3),
                      plane = Extent(pictures, 2) * width;
    T* const d_at = d_flow + 2 * b * places();
    ForEach<T>(b, [&](const T* picture, std::size_t i, const Place<T>& x, const Place<T>& y) {
      T d_x(0), d_y(0);
      for (std::size_t c = 0; c < channels; ++c) {
        const T* const p = picture + c * plane + y.low * width + x.low;
        const T* const q = p + y.step * width;
        const T d = d_out[(b * channels + c) * places() + i];
        const T upper = p[0] + x.share * (p[x.step] - p[0]);
        const T lower = q[0] + x.share * (q[x.step] - q[0]);
        d_x += d * ((T(1) - y.share) * (p[x.step] - p[0]) + y.share * (q[x.step] - q[0]));
        d_y += d * (lower - upper);
      }
      d_at[i] = d_x * x.slope;
      d_at[places() + i] = d_y * y.slope;
    });
  }
};

// The mean of each cell of one picture.
template <class T>
void FillCells(std::span<const T> image, std::size_t size, ColorCells<T>* cells) {
  const std::size_t side = size / kColorCells;
  const T scale = T(1) / static_cast<T>(side * side);
  for (auto& row : *cells) row.fill(0);
  for (std::size_t c = 0; c < 4; ++c) {
    for (std::size_t y = 0; y < side * kColorCells; ++y) {
      auto& row = (*cells)[y / side];
      const T* from = &image[(c * size + y) * size];
      for (std::size_t cell = 0; cell < kColorCells; ++cell, from += side) {
        T& sum = row[4 * cell + c];
        sum = std::accumulate(from, from + side, sum,
                              [scale](T so_far, T x) { return so_far + scale * x; });
      }
    }
  }
}

template <class T>
class Sampling {
 public:
  Sampling(const Workers& workers, const Tensor& images, Tensor flow)
      : flow_(std::move(flow)),
        batch_(static_cast<std::size_t>(images.shape()[0])),
        cells_(batch_) {
    const auto size = static_cast<std::size_t>(images.shape()[3]);
    const std::span<const T> all = images.span<T>();
    const std::size_t bytes = all.size() / batch_;
    workers.For(batch_, [&](std::size_t b) {
      FillCells<T>(all.subspan(b * bytes, bytes), size, &cells_[b]);
    });
  }

  std::size_t vertices() const { return flow_.elements() / (4 * batch_); }

  // colors: [B][V][3].
  void Forward(const Workers& workers, T* colors) {
    const T* flow = flow_.span<T>().data();
    workers.For(batch_, [&](std::size_t b) {
      const std::size_t v = b * vertices();
      SampleColors(cells_[b], {vertices(), flow + 4 * v, colors + 3 * v, nullptr, nullptr});
    });
  }
  // by_color: [B][V][3]; by_flow: [B][V][4].
  void Backward(const Workers& workers, const T* by_color, T* by_flow) {
    const T* flow = flow_.span<T>().data();
    workers.For(batch_, [&](std::size_t b) {
      const std::size_t v = b * vertices();
      SampleColorsBackward(cells_[b],
                           {vertices(), flow + 4 * v, nullptr, by_color + 3 * v, by_flow + 4 * v});
    });
  }

 private:
  Tensor flow_;
  std::size_t batch_;
  std::vector<ColorCells<T>> cells_;
};

template <class T>
ExternalOp MakeOp(Context& context, const Tensor& images, const Var& flow) {
  const Shape& shape = flow.shape();
  const auto sampling = std::make_shared<Sampling<T>>(context.workers(), images, flow.value());
  Tensor colors = context.Empty({shape[0], shape[1], 3}, flow.dtype());
  sampling->Forward(context.workers(), colors.span<T>().data());
  const auto backward = [&context, sampling, shape](std::span<const Tensor> d_outputs) {
    Tensor by_flow = context.Empty(shape, d_outputs[0].dtype());
    sampling->Backward(context.workers(), d_outputs[0].template span<T>().data(),
                       by_flow.span<T>().data());
    return std::vector<Tensor>{by_flow};
  };
  return {"sampled colours", {flow}, {colors}, backward};
}

}  // namespace

Var SamplePictures(const Tensor& pictures, const Var& flow) {
  if (!flow.valid()) return flow;
  const Shape &p = pictures.shape(), &f = flow.shape();
  if (p.rank() != 4 || f.rank() != 4 || f[1] != 2 || p[0] != f[0] ||
      pictures.dtype() != flow.dtype())
    return Fail(flow, InternalError("pictures {} cannot be looked up at {}", p, f));
  Context& context = flow.context();
  const PictureSampling at{pictures, flow.value()};
  const auto batch = static_cast<std::size_t>(p[0]);
  Tensor out = context.Empty({p[0], p[1], f[2], f[3]}, flow.dtype());
  WithFloatType(flow.dtype(), [&]<class T>(T) {
    context.workers().For(batch, [&](std::size_t b) { at.Forward(b, out.data<T>()); });
  });
  auto backward = [at, batch, &context](std::span<const Tensor> d) {
    Tensor d_flow = context.Empty(at.flow.shape(), at.flow.dtype());
    WithFloatType(at.flow.dtype(), [&]<class T>(T) {
      context.workers().For(
          batch, [&](std::size_t b) { at.Backward(b, d[0].span<T>().data(), d_flow.data<T>()); });
    });
    return std::vector<Tensor>{d_flow};
  };
  return External(context, {.name = "sample pictures",
                            .inputs = {flow},
                            .outputs = {out},
                            .backward = std::move(backward)})[0];
}

Var SampleColors(const Tensor& images, const Var& flow) {
  if (!flow.valid()) return flow;
  Context& context = flow.context();
  return WithFloatType(flow.dtype(), [&]<class T>(T) {
    return External(context, MakeOp<T>(context, images, flow))[0];
  });
}

}  // namespace tilegrad::nn
