// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/single_image/image_losses.h"

#include "nn/nn.h"
#include "train/losses/color_l1.h"
#include "train/tasks/equation14.h"

namespace tilegrad::train {

ImageLosses::ImageLosses(nn::Context& context, const SingleImageConfig& config,
                         const SphereModel& sphere, int image_size)
    : config_(config),
      image_size_(image_size),
      sphere_(sphere),
      renderer_(context.workers()),
      rival_(RivalOptions(config.render.rule, config.rivals).value()),
      rival_renderer_(context.workers()) {}

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
  return RenderScenes(renderer_, {.positions = meshes.positions, .colors = meshes.colors},
                      std::move(job));
}

RenderedImages ImageLosses::Draw(const Prediction& meshes, const BatchTensors& batch,
                                 std::int64_t step) {
  if (!rival_) return DrawOurs(meshes, batch, step);
  RivalJob job{sphere_.faces(), batch.cameras, image_size_, *rival_};
  job.options.softras.sigma = SoftRasSigmaAt(
      config_.rivals, static_cast<double>(step) / static_cast<double>(config_.schedule.steps));
  return RenderRival(rival_renderer_, meshes.positions, HasColor() ? meshes.colors : nn::Var(),
                     std::move(job));
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

}  // namespace tilegrad::train
