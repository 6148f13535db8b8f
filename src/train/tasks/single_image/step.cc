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

// Bytes to [0, 1]; rows of `size` pixels, each from right to left if mirrored.
struct Reader {
  std::size_t size;
  bool mirrored;
  template <class T>
  void Read(std::span<const std::uint8_t> from, T* to) const {
    for (std::size_t row = 0; row < from.size(); row += size) {
      for (std::size_t x = 0; x < size; ++x) {
        const std::size_t source = row + (mirrored ? size - 1 - x : x);
        to[row + x] = static_cast<T>(from[source]) * T(1.0 / 255);
      }
    }
  }
  // What image n of a batch is held to.
  template <class T>
  void ReadTruth(std::span<const std::uint8_t> image, std::size_t n, BatchTensors& out) const {
    const std::size_t plane = size * size;
    Read(image.first(3 * plane), out.truth_colors.data<T>() + 3 * plane * n);
    Read(image.subspan(3 * plane), out.truth_alpha.data<T>() + plane * n);
  }
};

}  // namespace

BatchTensors GatherBatch(nn::Context& context, const ImageStore& store,
                         const std::vector<Sample>& batch) {
  const auto objects = static_cast<std::int64_t>(batch.size()),
             size = static_cast<std::int64_t>(store.size);
  const auto views = batch[0].views.size();
  const std::int64_t images = objects * static_cast<std::int64_t>(views);
  BatchTensors out{context.Empty({objects, 4, size, size}),
                   context.Empty({images, 3, size, size}),
                   context.Empty({images, size, size}),
                   {}};
  for (const Sample& sample : batch) {
    for (const int view : sample.views) {
      const Camera& camera = store.cameras[static_cast<std::size_t>(view)];
      out.cameras.push_back(sample.mirrored ? MirroredCamera(camera, store.size) : camera);
    }
  }
  nn::WithFloatType(context.dtype(), [&]<class T>(T) {
    context.workers().For(batch.size(), [&](std::size_t b, std::size_t) {
      const Sample& sample = batch[b];
      const Reader reader{static_cast<std::size_t>(size), sample.mirrored};
      reader.Read(store.Image(sample.model, sample.views[0]),
                  out.input.data<T>() + b * store.ImageBytes());
      for (std::size_t v = 0; v < views; ++v) {
        reader.ReadTruth<T>(store.Image(sample.model, sample.views[v]), b * views + v, out);
      }
    });
  });
  return out;
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
