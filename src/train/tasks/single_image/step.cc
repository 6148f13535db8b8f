// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/single_image/step.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "base/error.h"
#include "nn/nn.h"
#include "train/losses/l1.h"
#include "train/tasks/common_config.h"

namespace tilegrad::train {

TrainStep::TrainStep(nn::Context& context, const SingleImageConfig& config, int image_size)
    : context_(context),
      config_(config),
      network_(context, config.network, image_size,
               static_cast<std::uint64_t>(config.schedule.seed)),
      weights_(context, network_.module(), config.optimizer, config.schedule.steps),
      losses_(context, config, network_.sphere(), image_size) {}

nn::Var TrainStep::Loss(const BatchTensors& batch, std::int64_t step, StepValues* values) {
  const Prediction meshes = network_.Forward(nn::Constant(context_, batch.input), nn::Mode::kTrain);
  return losses_.Total(meshes, batch, step, values);
}

ImageLosses::ImageLosses(nn::Context& context, const SingleImageConfig& config,
                         const SphereModel& sphere, int image_size)
    : config_(config),
      image_size_(image_size),
      sphere_(sphere),
      renderer_(context),
      rival_(RivalOptions(config.render.rule, config.rivals).value()),
      rival_renderer_(context) {}

bool ImageLosses::HasColor() const {
  return !rival_ || (rival_->rule == rivals::Rule::kSoftRas ? config_.rivals.softras_color
                                                            : config_.rivals.n3mr_color);
}

RenderedImages ImageLosses::DrawOurs(const Prediction& meshes, const BatchTensors& batch,
                                     std::int64_t step) {
  const double sharpness = SharpnessAt(config_.render, config_.schedule.steps, step);
  RenderJob job = sphere_.Job(OptionsOf(config_.render, sharpness, image_size_));
  job.cameras = batch.cameras;
  job.views =
      static_cast<int>(batch.cameras.size() / static_cast<std::size_t>(batch.input.shape()[0]));
  return RenderScenes(renderer_.Here(), {.positions = meshes.positions, .colors = meshes.colors},
                      std::move(job));
}

RenderedImages ImageLosses::Draw(const Prediction& meshes, const BatchTensors& batch,
                                 std::int64_t step) {
  if (!rival_) return DrawOurs(meshes, batch, step);
  RivalJob job{sphere_.faces(), batch.cameras, image_size_, *rival_};
  job.options.softras.sigma = SoftRasSigmaAt(
      config_.rivals, static_cast<double>(step) / static_cast<double>(config_.schedule.steps));
  return RenderRival(rival_renderer_.Here(), meshes.positions,
                     HasColor() ? meshes.colors : nn::Var(), std::move(job));
}

nn::Var ImageLosses::Total(const Prediction& meshes, const BatchTensors& batch, std::int64_t step,
                           StepValues* values) {
  const RenderedImages images = Draw(meshes, batch, step);
  const LossConfig& w = config_.loss;
  LossSum sum(values);
  AddIou(w.iou, images.alpha, batch.truth_alpha, &sum);
  if (HasColor()) AddColor(w.color, ColorL1Loss(images.colors, batch.truth_colors), &sum);
  AddRegularizers(w, {sphere_.mesh().faces, sphere_.topology(), meshes.positions, meshes.movement},
                  &sum);
  return sum.total();
}

namespace {

// Numbers times `scale`; rows of `size` pixels, each from right to left if mirrored.
template <class From>
struct BatchReader {
  std::size_t size;
  bool mirrored;
  double scale;
  template <class T>
  void Read(std::span<const From> from, T* to) const {
    for (std::size_t i = 0; i < from.size(); ++i)
      to[i] = static_cast<T>(from[i]) * static_cast<T>(scale);
    for (std::size_t row = 0; mirrored && row < from.size(); row += size)
      std::reverse(to + row, to + row + size);
  }
  // The target of image n of a batch.
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
  std::vector<Sample> batch;
  StreamedObjects stream;
  std::size_t views, streamed;  // streamed: of the batch, the first ones
  BatchTensors out;
  std::vector<TexturedView> drawn = std::vector<TexturedView>(views * streamed);
  std::vector<Status> failures = std::vector<Status>(streamed);

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
  void FromStore(std::size_t b) {
    const Sample& sample = batch[b];
    const BatchReader<std::uint8_t> reader{static_cast<std::size_t>(store.size), sample.mirrored,
                                           1.0 / 255};
    Fill<T>(b, reader, [&](std::size_t v) { return store.Image(sample.model, sample.views[v]); });
    for (std::size_t v = 0; v < views; ++v)
      CamerasOf(b)[v] = store.CameraOf(sample.model, sample.views[v]);
    Mirror(b);
  }
  template <class T>
  void FromStream(std::size_t b, std::size_t lane) {
    const auto seen = std::span(drawn).subspan(b * views, views);
    const auto position = static_cast<std::uint64_t>(stream.first) + b;
    const auto rgba = stream.from->Render(batch[b].model, position, lane, seen);
    failures[b] = rgba.status();
    if (!rgba.ok()) return;
    std::ranges::transform(seen, CamerasOf(b).begin(), &TexturedView::camera);
    const BatchReader<float> reader{static_cast<std::size_t>(store.size), batch[b].mirrored, 1};
    Fill<T>(b, reader, [&](std::size_t v) {
      return rgba->subspan(v * store.ImageBytes(), store.ImageBytes());
    });
    Mirror(b);
  }
  void Mirror(std::size_t b) {
    if (!batch[b].mirrored) return;
    for (Camera& camera : CamerasOf(b)) camera = MirroredCamera(camera, store.size);
  }

  void Run(std::size_t b, std::size_t lane) {
    nn::WithFloatType(out.input.dtype(),
                      [&]<class T>(T) { b < streamed ? FromStream<T>(b, lane) : FromStore<T>(b); });
  }
  Result<BatchTensors> Finish() {
    for (const Status& failure : failures) TILEGRAD_TRY(failure);
    if (stream.from != nullptr) out.stream_seconds = stream.from->TakeSeconds();
    return std::move(out);
  }
};

}  // namespace

BatchTensors GatherBatch(nn::Context& context, const ImageStore& store,
                         const std::vector<Sample>& batch) {
  return *MakeNow(GatherWork(context, store, batch, {}), context);
}

BatchWork<BatchTensors> GatherWork(nn::Context& context, const ImageStore& store,
                                   std::vector<Sample> batch, const StreamedObjects& stream) {
  const auto objects = static_cast<std::int64_t>(batch.size()),
             size = static_cast<std::int64_t>(store.size);
  const std::size_t views = batch[0].views.size();
  const std::size_t streamed = stream.from != nullptr ? stream.from->Count(batch.size()) : 0;
  const std::int64_t images = objects * static_cast<std::int64_t>(views);
  BatchTensors out{context.Empty({objects, 4, size, size}), context.Empty({images, 3, size, size}),
                   context.Empty({images, size, size}),
                   std::vector<Camera>(static_cast<std::size_t>(images))};
  const auto work = std::make_shared<Gathering>(
      Gathering{store, std::move(batch), stream, views, streamed, std::move(out)});
  return {work->batch.size(), [work](std::size_t b, std::size_t lane) { work->Run(b, lane); },
          [work] { return work->Finish(); }};
}

}  // namespace tilegrad::train
