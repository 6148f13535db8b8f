// SPDX-License-Identifier: Apache-2.0
#include "train/ops/sample_colors.h"

#include <memory>
#include <vector>

#include "nn/nn.h"
#include "train/ops/sample_colors_ref.h"

namespace tilegrad::train {
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
      for (std::size_t x = 0; x < side * kColorCells; ++x) row[4 * (x / side) + c] += scale * from[x];
    }
  }
}

template <class T>
class Sampling {
 public:
  Sampling(const nn::Tensor& images, nn::Tensor flow)
      : flow_(std::move(flow)), batch_(static_cast<std::size_t>(images.shape()[0])), cells_(batch_) {
    const auto size = static_cast<std::size_t>(images.shape()[3]);
    const std::span<const T> all = images.span<T>();
    const std::size_t bytes = all.size() / batch_;
    for (std::size_t b = 0; b < batch_; ++b)
      FillCells<T>(all.subspan(b * bytes, bytes), size, &cells_[b]);
  }

  // visit(the vertex's colour, its number) of every vertex, in parallel.
  template <class Visit>
  void ForEach(const Workers& workers, const Visit& visit) const {
    const T* flow = flow_.span<T>().data();
    const std::size_t vertices = flow_.elements() / (4 * batch_);
    workers.For(batch_, [&](std::size_t b, std::size_t) {
      for (std::size_t v = b * vertices; v < (b + 1) * vertices; ++v)
        visit(SampledColor<T>(cells_[b], flow + 4 * v), v);
    });
  }

 private:
  nn::Tensor flow_;
  std::size_t batch_;
  std::vector<ColorCells<T>> cells_;
};

template <class T>
nn::ExternalOp MakeOp(nn::Context& context, const nn::Tensor& images, const nn::Var& flow) {
  const nn::Shape& shape = flow.shape();
  const auto sampling = std::make_shared<Sampling<T>>(images, flow.value());
  nn::Tensor colors = context.Empty({shape[0], shape[1], 3}, flow.dtype());
  T* out = colors.span<T>().data();
  sampling->ForEach(context.workers(), [out](const SampledColor<T>& color, std::size_t v) {
    color.Forward(out + 3 * v);
  });
  const auto backward = [&context, sampling, shape](std::span<const nn::Tensor> d_outputs) {
    nn::Tensor d_flow = context.Empty(shape, d_outputs[0].dtype());
    const T* d_colors = d_outputs[0].template span<T>().data();
    T* d = d_flow.span<T>().data();
    sampling->ForEach(context.workers(), [=](const SampledColor<T>& color, std::size_t v) {
      color.Backward(d_colors + 3 * v, d + 4 * v);
    });
    return std::vector<nn::Tensor>{d_flow};
  };
  return {"sampled colours", {flow}, {colors}, backward};
}

}  // namespace

nn::Var SampleColors(const nn::Tensor& images, const nn::Var& flow) {
  if (!flow.valid()) return flow;
  nn::Context& context = flow.context();
  return nn::WithFloatType(flow.dtype(), [&]<class T>(T) {
    return nn::External(context, MakeOp<T>(context, images, flow))[0];
  });
}

}  // namespace tilegrad::train
