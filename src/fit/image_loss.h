// SPDX-License-Identifier: Apache-2.0
// What renders are held to, and how far they are from it.
#pragma once

#include <cstdint>
#include <span>

#include "base/aligned.h"
#include "train/losses/loss_sum.h"

namespace tilegrad::train {

// N images of one size, planar.
struct TargetImages {
  int width = 0, height = 0;
  AlignedVector<float> color;  // [N,3,H,W]
  AlignedVector<float> alpha;  // [N,H,W] in [0, 1]
  // The masks that silhouettes and hulls are fitted to, of the same shape; empty: alpha.
  AlignedVector<float> silhouette = {};

  const AlignedVector<float>& outline() const { return silhouette.empty() ? alpha : silhouette; }
  std::size_t pixels() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
};

enum class SilhouetteLoss { kIou, kSquared };  // train/losses/iou.h

// Weights; colours count where a face is drawn, weighted by the target's alpha.
struct ImageLoss {
  double color_weight = 1, silhouette_weight = 1;
  SilhouetteLoss silhouette = SilhouetteLoss::kIou;
};

// Views of a scene on the tape: image i shows view views[i].
struct RenderedViews {
  std::span<const int> views;
  nn::Var colors, alpha;                // [N,3,H,W], [N,H,W]
  std::span<const std::int32_t> faces;  // [N,H,W] drawn, or < 0
};

// Adds the terms that have a weight, means over the views.
void AddImageLosses(const ImageLoss& loss, const TargetImages& targets,
                    const RenderedViews& rendered, LossSum* sum);

}  // namespace tilegrad::train
