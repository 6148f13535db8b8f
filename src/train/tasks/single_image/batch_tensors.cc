// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/single_image/batch_tensors.h"

#include <algorithm>

#include "nn/nn.h"

namespace tilegrad::train {
namespace {

// Numbers times `scale`; rows of `size` pixels, each from right to left if mirrored.
template <class From>
struct BatchReader {
  std::size_t size;
  bool mirrored;
  double scale;
  template <class T>
  void Read(std::span<const From> from, T* to) const {
    for (std::size_t row = 0; row < from.size(); row += size) {
      for (std::size_t x = 0; x < size; ++x) {
        const std::size_t source = row + (mirrored ? size - 1 - x : x);
        to[row + x] = static_cast<T>(from[source]) * static_cast<T>(scale);
      }
    }
  }
  // What image n of a batch is held to.
  template <class T>
  void ReadTruth(std::span<const From> image, std::size_t n, BatchTensors& out) const {
    const std::size_t plane = size * size;
    Read(image.first(3 * plane), out.truth_colors.data<T>() + 3 * plane * n);
    Read(image.subspan(3 * plane), out.truth_alpha.data<T>() + plane * n);
  }
};

// A batch under construction.
struct Gathering {
  const ImageStore& store;
  std::size_t views;
  BatchTensors out;

  // Object b, whose view v is image(v).
  template <class T, class From, class Image>
  void Fill(std::size_t b, const BatchReader<From>& reader, const Image& image) {
    reader.Read(image(0), out.input.data<T>() + b * store.ImageBytes());
    for (std::size_t v = 0; v < views; ++v)
      reader.template ReadTruth<T>(image(v), b * views + v, out);
  }
  std::span<Camera> CamerasOf(std::size_t b) {
    return std::span(out.cameras).subspan(b * views, views);
  }

  template <class T>
  void FromStore(std::size_t b, const Sample& sample) {
    const BatchReader<std::uint8_t> reader{static_cast<std::size_t>(store.size), sample.mirrored,
                                           1.0 / 255};
    Fill<T>(b, reader, [&](std::size_t v) { return store.Image(sample.model, sample.views[v]); });
    for (std::size_t v = 0; v < views; ++v)
      CamerasOf(b)[v] = store.CameraOf(sample.model, sample.views[v]);
    Mirror(b, sample);
  }
  template <class T>
  void FromStream(std::size_t b, const Sample& sample, std::span<const float> rgba) {
    const BatchReader<float> reader{static_cast<std::size_t>(store.size), sample.mirrored, 1};
    Fill<T>(b, reader, [&](std::size_t v) {
      return rgba.subspan(v * store.ImageBytes(), store.ImageBytes());
    });
    Mirror(b, sample);
  }
  void Mirror(std::size_t b, const Sample& sample) {
    if (!sample.mirrored) return;
    for (Camera& camera : CamerasOf(b)) camera = MirroredCamera(camera, store.size);
  }
};

}  // namespace

BatchTensors GatherBatch(nn::Context& context, const ImageStore& store,
                         const std::vector<Sample>& batch) {
  return *GatherBatch(context, store, batch, nullptr, 0);
}

Result<BatchTensors> GatherBatch(nn::Context& context, const ImageStore& store,
                                 const std::vector<Sample>& batch, TexturedStream* stream,
                                 std::int64_t first) {
  const auto objects = static_cast<std::int64_t>(batch.size()),
             size = static_cast<std::int64_t>(store.size);
  const auto views = batch[0].views.size();
  const std::int64_t images = objects * static_cast<std::int64_t>(views);
  Gathering gathering{
      store,
      views,
      {context.Empty({objects, 4, size, size}), context.Empty({images, 3, size, size}),
       context.Empty({images, size, size}), std::vector<Camera>(static_cast<std::size_t>(images))}};
  const std::size_t streamed = stream ? stream->Count(batch.size()) : 0;
  std::vector<Status> failures(streamed);
  std::vector<std::vector<TexturedView>> streamed_views(
      static_cast<std::size_t>(context.workers().count()));
  nn::WithFloatType(context.dtype(), [&]<class T>(T) {
    context.workers().For(batch.size(), [&](std::size_t b, std::size_t worker) {
      const Sample& sample = batch[b];
      if (b >= streamed) return gathering.FromStore<T>(b, sample);
      const auto position = static_cast<std::uint64_t>(first) + b;
      std::vector<TexturedView>& drawn = streamed_views[worker];
      drawn.resize(views);
      const auto rgba = stream->Render(sample.model, position, worker, drawn);
      std::ranges::transform(drawn, gathering.CamerasOf(b).begin(), &TexturedView::camera);
      failures[b] = rgba.status();
      if (rgba.ok()) gathering.FromStream<T>(b, sample, *rgba);
    });
  });
  for (const Status& failure : failures) TILEGRAD_TRY(failure);
  return std::move(gathering.out);
}

}  // namespace tilegrad::train
