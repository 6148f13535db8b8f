// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/single_image/image_losses.h"

#include <algorithm>
#include <cmath>

#include "nn/nn.h"
#include "train/losses/color_l1.h"
#include "train/losses/iou.h"
#include "train/losses/laplacian.h"
#include "train/losses/smoothness.h"

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
                           std::int64_t step, LossValues* values) {
  const RenderedImages images = Draw(meshes, batch, step);
  const nn::Var iou = IouLoss(images.alpha, batch.truth_alpha);
  const nn::Var smoothness = SmoothnessLoss(meshes.positions, faces_, topology_);
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

void ImageLosses::AddTerms(const LossValues& v, std::vector<LossTerm>* terms) const {
  const LossConfig& w = config_.loss;
  terms->push_back({"iou", w.iou, v.iou});
  if (v.has_color) terms->push_back({"color", w.color, v.color});
  terms->push_back({"smoothness", w.smoothness, v.smoothness});
  terms->push_back({"laplacian", w.laplacian, v.laplacian});
}

}  // namespace tilegrad::train
