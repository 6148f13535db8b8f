// SPDX-License-Identifier: Apache-2.0
#include "fit/image_loss.h"

#include <algorithm>

#include "train/losses/iou.h"
#include "train/losses/l1.h"

namespace tilegrad::train {
namespace {

// Of all images, those of some views, one after another.
nn::Tensor ViewsOf(std::span<const float> all, std::span<const int> views, const nn::Var& like) {
  nn::Tensor out = like.context().Empty(like.shape(), nn::DType::kF32);
  const std::size_t size = out.elements() / views.size();
  for (std::size_t i = 0; i < views.size(); ++i)
    std::copy_n(&all[size * static_cast<std::size_t>(views[i])], size,
                out.data<float>() + size * i);
  return out;
}

// The targets' alpha where a face is drawn, [N,H,W].
nn::Tensor ColorWeights(const TargetImages& targets, const RenderedViews& rendered) {
  const nn::Shape& shape = rendered.colors.shape();
  nn::Tensor out = rendered.colors.context().Empty({shape[0], shape[2], shape[3]}, nn::DType::kF32);
  const std::size_t plane = targets.pixels();
  for (std::size_t i = 0; i < rendered.views.size(); ++i) {
    const float* const alpha = &targets.alpha[plane * static_cast<std::size_t>(rendered.views[i])];
    const std::int32_t* const face = &rendered.faces[plane * i];
    float* const to = out.data<float>() + plane * i;
    for (std::size_t p = 0; p < plane; ++p) to[p] = face[p] >= 0 ? alpha[p] : 0.0f;
  }
  return out;
}

nn::Var SilhouetteLossOf(SilhouetteLoss loss, const TargetImages& targets,
                         const RenderedViews& rendered) {
  const nn::Tensor truth = ViewsOf(targets.outline(), rendered.views, rendered.alpha);
  return loss == SilhouetteLoss::kIou ? IouLoss(rendered.alpha, truth)
                                      : SquaredSilhouetteLoss(rendered.alpha, truth);
}

}  // namespace

void AddImageLosses(const ImageLoss& loss, const TargetImages& targets,
                    const RenderedViews& rendered, LossSum* sum) {
  if (loss.color_weight > 0) {
    sum->Add("color", "Colour loss (mean difference)", loss.color_weight,
             WeightedColorL1Loss(rendered.colors,
                                 ViewsOf(targets.color, rendered.views, rendered.colors),
                                 ColorWeights(targets, rendered)));
  }
  if (loss.silhouette_weight > 0) {
    sum->Add("silhouette", "Silhouette loss", loss.silhouette_weight,
             SilhouetteLossOf(loss.silhouette, targets, rendered));
  }
}

}  // namespace tilegrad::train
