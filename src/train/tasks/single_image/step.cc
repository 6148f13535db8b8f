// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/single_image/step.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "nn/nn.h"
#include "train/losses/color_l1.h"
#include "train/losses/iou.h"
#include "train/losses/laplacian.h"
#include "train/losses/smoothness.h"
#include "train/ops/render_op.h"

namespace tilegrad::train {
namespace {

// Numbers times `scale`; rows of `size` pixels, each from right to left if mirrored.
template <class From>
struct Reader {
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

// A batch in the making.
struct Gathering {
  const ImageStore& store;
  std::size_t views;
  BatchTensors out;

  // Object b, whose view v is image(v).
  template <class T, class From, class Image>
  void Fill(std::size_t b, const Reader<From>& reader, const Image& image) {
    reader.Read(image(0), out.input.data<T>() + b * store.ImageBytes());
    for (std::size_t v = 0; v < views; ++v)
      reader.template ReadTruth<T>(image(v), b * views + v, out);
  }
  std::span<Camera> CamerasOf(std::size_t b) {
    return std::span(out.cameras).subspan(b * views, views);
  }

  template <class T>
  void FromStore(std::size_t b, const Sample& sample) {
    const Reader<std::uint8_t> reader{static_cast<std::size_t>(store.size), sample.mirrored,
                                      1.0 / 255};
    Fill<T>(b, reader, [&](std::size_t v) { return store.Image(sample.model, sample.views[v]); });
    for (std::size_t v = 0; v < views; ++v)
      CamerasOf(b)[v] = store.cameras[static_cast<std::size_t>(sample.views[v])];
    Mirror(b, sample);
  }
  template <class T>
  void FromStream(std::size_t b, const Sample& sample, std::span<const float> rgba) {
    const Reader<float> reader{static_cast<std::size_t>(store.size), sample.mirrored, 1};
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
                                 const std::vector<Sample>& batch, SceneStream* stream,
                                 std::int64_t step) {
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
  nn::WithFloatType(context.dtype(), [&]<class T>(T) {
    context.workers().For(batch.size(), [&](std::size_t b, std::size_t worker) {
      const Sample& sample = batch[b];
      if (b >= streamed) return gathering.FromStore<T>(b, sample);
      const auto position = static_cast<std::uint64_t>(step) * batch.size() + b;
      const auto rgba = stream->Render(sample.model, position, worker, gathering.CamerasOf(b));
      failures[b] = rgba.status();
      if (rgba.ok()) gathering.FromStream<T>(b, sample, *rgba);
    });
  });
  for (const Status& failure : failures) TILEGRAD_TRY(failure);
  return std::move(gathering.out);
}

double LearningRateAt(const SingleImageConfig& config, std::int64_t step) {
  const OptimizerConfig& o = config.optimizer;
  const nn::CosineSchedule cosine{config.schedule.steps, o.final_factor};
  return nn::WarmedUp(nn::CosineRate(o.learning_rate, cosine, step), o.warmup, step);
}

double SharpnessAt(const SingleImageConfig& config, std::int64_t step) {
  const double share =
      std::min(1.0, 2.0 * static_cast<double>(step) / static_cast<double>(config.schedule.steps));
  return config.render.sharpness_start *
         std::pow(config.render.sharpness / config.render.sharpness_start, share);
}

TrainStep::TrainStep(nn::Context& context, const SingleImageConfig& config, int image_size)
    : context_(context),
      config_(config),
      image_size_(image_size),
      network_(context, config.network, image_size,
               static_cast<std::uint64_t>(config.schedule.seed)),
      adam_(context, nn::Parameters(network_.module()),
            {.learning_rate = config.optimizer.learning_rate,
             .beta1 = config.optimizer.beta1,
             .beta2 = config.optimizer.beta2}),
      average_(context,
               config.optimizer.average > 0 ? nn::State(network_.module())
                                            : std::vector<nn::NamedTensor>(),
               config.optimizer.average),
      topology_(
          BuildTopology(network_.template_mesh().faces, network_.template_mesh().positions.size())),
      renderer_(context.workers()),
      rival_(RivalOptions(config.render.rule, config.rivals).value()),
      rival_renderer_(context.workers()) {}

RenderOptions TrainStep::OptionsAt(std::int64_t step) const {
  RenderOptions options;
  options.width = options.height = image_size_;
  options.delta = 1 / SharpnessAt(config_, step);
  options.max_alpha_error = config_.render.max_alpha_error;
  return options;
}

std::span<const std::int32_t> TrainStep::faces() const {
  const auto& faces = network_.template_mesh().faces;
  return {faces[0].data(), 3 * faces.size()};
}

bool TrainStep::HasColor() const {
  return !rival_ || (rival_->rule == rivals::Rule::kSoftRas ? config_.rivals.softras_color
                                                            : config_.rivals.n3mr_color);
}

RenderedImages TrainStep::Draw(const PredictedMeshes& meshes, const BatchTensors& batch,
                               std::int64_t step) {
  if (!rival_) {
    const int views =
        static_cast<int>(batch.cameras.size() / static_cast<std::size_t>(batch.input.shape()[0]));
    return RenderScenes(renderer_, {.positions = meshes.positions, .colors = meshes.colors},
                        {faces(), batch.cameras, views, OptionsAt(step)});
  }
  RivalJob job{faces(), batch.cameras, image_size_, *rival_};
  job.options.softras.sigma = SoftRasSigmaAt(
      config_.rivals, static_cast<double>(step) / static_cast<double>(config_.schedule.steps));
  return RenderRival(rival_renderer_, meshes.positions, HasColor() ? meshes.colors : nn::Var(),
                     std::move(job));
}

nn::Var TrainStep::Loss(const BatchTensors& batch, std::int64_t step, LossValues* values) {
  const PredictedMeshes meshes =
      network_.Forward(nn::Constant(context_, batch.input), nn::Mode::kTrain);
  const RenderedImages images = Draw(meshes, batch, step);
  const nn::Var iou = IouLoss(images.alpha, batch.truth_alpha);
  const nn::Var smoothness =
      SmoothnessLoss(meshes.positions, network_.template_mesh().faces, topology_);
  const nn::Var laplacian = LaplacianLoss(meshes.movement, topology_);
  const LossConfig& w = config_.loss;
  nn::Var total = w.iou * iou, color;  // equation 14
  if (HasColor()) {
    color = ColorL1Loss(images.colors, batch.truth_colors);
    total = total + w.color * color;
  }
  total = total + w.smoothness * smoothness + w.laplacian * laplacian;
  *values = {total.item(),      iou.item(),       color.valid() ? color.item() : 0,
             smoothness.item(), laplacian.item(), HasColor()};
  return total;
}

void TrainStep::AddTerms(const LossValues& v, std::vector<LossTerm>* terms) const {
  const LossConfig& w = config_.loss;
  terms->push_back({"iou", w.iou, v.iou});
  if (v.has_color) terms->push_back({"color", w.color, v.color});
  terms->push_back({"smoothness", w.smoothness, v.smoothness});
  terms->push_back({"laplacian", w.laplacian, v.laplacian});
}

Result<nn::StepVector<nn::Gradient>> TrainStep::Backward(const BatchTensors& batch,
                                                         std::int64_t step, LossValues* values) {
  const nn::Var loss = Loss(batch, step, values);
  auto gradients = nn::Gradients(loss, adam_.parameters());
  TILEGRAD_TRY(context_.TakeStatus());
  if (std::isfinite(values->total) && nn::IsFinite(context_, gradients)) return gradients;
  StepValues described;
  AddTerms(*values, &described.terms);
  return InternalError(
      "the loss is {} ({}), the gradient's norm {}; a smaller optimizer.learning_rate may help",
      values->total, described.DescribeTerms(), nn::GlobalNorm(context_, gradients));
}

Status TrainStep::Update(std::span<const nn::Gradient> gradients, std::int64_t step) {
  adam_.options().learning_rate = LearningRateAt(config_, step);
  TILEGRAD_TRY(adam_.Step(gradients));
  average_.Update();
  return {};
}

}  // namespace tilegrad::train
