// SPDX-License-Identifier: Apache-2.0
#include "nn/ops/sample_colors.h"

#include <memory>
#include <vector>

#include "nn/kernels/sample_colors.h"
#include "nn/nn.h"

namespace tilegrad::nn {
namespace {

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
      for (std::size_t x = 0; x < side * kColorCells; ++x)
        row[4 * (x / side) + c] += scale * from[x];
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
    workers.For(batch_, [&](std::size_t b, std::size_t) {
      FillCells<T>(all.subspan(b * bytes, bytes), size, &cells_[b]);
    });
  }

  std::size_t vertices() const { return flow_.elements() / (4 * batch_); }

  // colors: [B][V][3].
  void Forward(const Workers& workers, T* colors) {
    const T* flow = flow_.span<T>().data();
    workers.For(batch_, [&](std::size_t b, std::size_t) {
      const std::size_t v = b * vertices();
      SampleColors(cells_[b], {vertices(), flow + 4 * v, colors + 3 * v, nullptr, nullptr});
    });
  }
  // by_color: [B][V][3]; by_flow: [B][V][4].
  void Backward(const Workers& workers, const T* by_color, T* by_flow) {
    const T* flow = flow_.span<T>().data();
    workers.For(batch_, [&](std::size_t b, std::size_t) {
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

Var SampleColors(const Tensor& images, const Var& flow) {
  if (!flow.valid()) return flow;
  Context& context = flow.context();
  return WithFloatType(flow.dtype(), [&]<class T>(T) {
    return External(context, MakeOp<T>(context, images, flow))[0];
  });
}

}  // namespace tilegrad::nn
