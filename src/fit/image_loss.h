// SPDX-License-Identifier: Apache-2.0
// What renders are held to, and how far they are from it.
#pragma once

#include <span>
#include <vector>

#include "base/aligned.h"
#include "base/parallel.h"
#include "render/frame_images.h"

namespace tilegrad::train {

// N images of one size, planar.
struct TargetImages {
  int width = 0, height = 0;
  AlignedVector<float> color;  // [N,3,H,W]
  AlignedVector<float> alpha;  // [N,H,W] in [0, 1]
  // What silhouettes are held to, of the same shape; empty: alpha.
  AlignedVector<float> silhouette = {};

  std::size_t pixels() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
};

// Equation 12; or the squared differences' sum over the silhouette's area, which is least where
// both agree also between 0 and 1, while the other wants 0 or 1.
enum class SilhouetteLoss { kIou, kSquared };

// Colours count where a face is drawn, weighted by the target's alpha.
struct ImageLoss {
  double color_weight = 1, silhouette_weight = 1;
  SilhouetteLoss silhouette = SilhouetteLoss::kIou;
};

struct ImageLossValue {
  double color = 0;       // L1: mean over pixels and channels of |difference|, unweighted
  double silhouette = 0;  // unweighted
  double total = 0;       // weighted
};

// Means over the views. Keeps its arrays: the same sizes allocate nothing.
class ImageLossRule {
 public:
  // Image i of the frame, its colours times gains[views[i]], is held to image views[i] of
  // `targets`. Fills d_color, d_alpha and, where there are gains, d_gains with the gradient of the
  // total.
  struct Views {
    std::span<const int> views;
    std::span<const float> gains;  // of all views, or none: 1
  };
  ImageLossValue Evaluate(const ImageLoss& loss, const TargetImages& targets, const Views& views,
                          const Images& frame, const Workers& workers);
  const AlignedVector<float>& d_color() const { return d_color_; }
  const AlignedVector<float>& d_alpha() const { return d_alpha_; }
  const AlignedVector<float>& d_gains() const { return d_gains_; }  // [views]

 private:
  AlignedVector<float> d_color_, d_alpha_, d_gains_;
  std::vector<ImageLossValue> parts_;  // of each view
};

}  // namespace tilegrad::train
