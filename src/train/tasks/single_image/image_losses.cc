// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/single_image/image_losses.h"

#include <algorithm>
#include <cmath>

#include "nn/nn.h"
#include "train/losses/color_l1.h"
#include "train/tasks/equation14.h"

namespace tilegrad::train {

double SharpnessAt(const SingleImageConfig& config, std::int64_t step) {
  return SharpnessAt(config.render, config.schedule.steps, step);
}

ImageLosses::ImageLosses(nn::Context& context, const SingleImageConfig& config, const Mesh& sphere,
                         int image_size)
    : config_(config),
      image_size_(image_size),
      faces_(sphere.faces),
      topology_(BuildTopology(sphere.faces, sphere.positions.size())),
      renderer_(context.workers()),
      rival_(RivalOptions(config.render.rule, config.rivals).value()),
      rival_renderer_(context.workers()) {}

RenderOptions ImageLosses::OptionsAt(std::int64_t step) const {
  RenderOptions options;
  options.width = options.height = image_size_;
  options.delta = 1 / SharpnessAt(config_, step);
  options.max_alpha_error = config_.render.max_alpha_error;
  return options;
}

bool ImageLosses::HasColor() const {
  return !rival_ || (rival_->rule == rivals::Rule::kSoftRas ? config_.rivals.softras_color
                                                            : config_.rivals.n3mr_color);
}

RenderedImages ImageLosses::Draw(const PredictedMeshes& meshes, const BatchTensors& batch,
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

nn::Var ImageLosses::Total(const PredictedMeshes& meshes, const BatchTensors& batch,
                           std::int64_t step, StepValues* values) {
  const RenderedImages images = Draw(meshes, batch, step);
  const LossConfig& w = config_.loss;
  LossSum sum(values);
  AddIou(w.iou, images.alpha, batch.truth_alpha, &sum);
  if (HasColor()) AddColor(w.color, ColorL1Loss(images.colors, batch.truth_colors), &sum);
  AddRegularizers(w, {meshes.positions, meshes.movement, faces_, topology_}, &sum);
  return sum.total();
}

}  // namespace tilegrad::train
