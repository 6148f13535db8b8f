// SPDX-License-Identifier: Apache-2.0
#include "fit/image_loss.h"

#include <algorithm>
#include <cmath>

#include "train/losses/iou.h"

namespace tilegrad::train {
namespace {

// One image; color is [3,H,W].
struct OneImage {
  std::span<const float> truth, truth_alpha, silhouette, color, alpha;
  std::span<const std::int32_t> faces;
  std::span<float> d_color, d_alpha;
  float gain = 1;
  float* d_gain = nullptr;  // none: the gain is 1
};

// Mean of weight * |gain * color - truth|; the gradient times `scale`.
double WeightedL1(const OneImage& image, double scale) {
  const std::size_t plane = image.faces.size();
  const double step = scale / static_cast<double>(3 * plane);
  double sum = 0, d_gain = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t p = 0; p < plane; ++p) {
      const std::size_t i = c * plane + p;
      const float weight = image.faces[p] >= 0 ? image.truth_alpha[p] : 0.0f;
      const float gap = image.gain * image.color[i] - image.truth[i];
      sum += static_cast<double>(weight * std::abs(gap));
      const float sign = gap > 0 ? 1.0f : gap < 0 ? -1.0f : 0.0f;
      const float d_gap = static_cast<float>(step) * weight * sign;
      image.d_color[i] = image.gain * d_gap;
      d_gain += static_cast<double>(d_gap * image.color[i]);
    }
  }
  if (image.d_gain != nullptr) *image.d_gain = static_cast<float>(d_gain);
  return sum / static_cast<double>(3 * plane);
}

double Iou(const OneImage& image, double scale) {
  const IouSums<float> sums(image.silhouette, image.alpha);
  IouBackward<float>(sums, image.silhouette, scale, image.d_alpha);
  return sums.loss();
}

double Squared(const OneImage& image, double scale) {
  double area = 0, sum = 0;
  for (const float s : image.silhouette) area += static_cast<double>(s);
  area = std::max(area, 1.0);
  const auto step = static_cast<float>(2 * scale / area);
  for (std::size_t p = 0; p < image.silhouette.size(); ++p) {
    const float gap = image.alpha[p] - image.silhouette[p];
    sum += static_cast<double>(gap * gap);
    image.d_alpha[p] = step * gap;
  }
  return sum / area;
}

ImageLossValue EvaluateOne(const ImageLoss& loss, const OneImage& image, double share) {
  ImageLossValue value;
  if (loss.color_weight > 0) value.color = WeightedL1(image, share * loss.color_weight);
  if (loss.silhouette_weight > 0) {
    const double scale = share * loss.silhouette_weight;
    value.silhouette =
        loss.silhouette == SilhouetteLoss::kIou ? Iou(image, scale) : Squared(image, scale);
  }
  value.total = loss.color_weight * value.color + loss.silhouette_weight * value.silhouette;
  return value;
}

}  // namespace

ImageLossValue ImageLossRule::Evaluate(const ImageLoss& loss, const TargetImages& targets,
                                       const Views& of, const Images& frame,
                                       const Workers& workers) {
  const std::span<const int> views = of.views;
  const std::size_t plane = targets.pixels(), images = views.size();
  d_gains_.assign(of.gains.empty() ? 0 : images, 0.0f);
  d_color_.resize(loss.color_weight > 0 ? 3 * plane * images : 0);
  d_alpha_.resize(loss.silhouette_weight > 0 ? plane * images : 0);
  parts_.resize(images);
  const double share = 1.0 / static_cast<double>(images);
  workers.For(images, [&](std::size_t i, std::size_t) {
    const auto v = static_cast<std::size_t>(views[i]);
    const auto part = [&](auto& array, std::size_t n, std::size_t size) {
      return array.empty() ? std::span(array) : std::span(array).subspan(n * size, size);
    };
    OneImage image{part(targets.color, v, 3 * plane),
                   part(targets.alpha, v, plane),
                   part(targets.silhouette.empty() ? targets.alpha : targets.silhouette, v, plane),
                   part(frame.color, i, 3 * plane),
                   part(frame.alpha, i, plane),
                   part(frame.face_ids, i, plane),
                   part(d_color_, i, 3 * plane),
                   part(d_alpha_, i, plane)};
    if (!of.gains.empty()) {
      image.gain = of.gains[v];
      image.d_gain = &d_gains_[i];
    }
    parts_[i] = EvaluateOne(loss, image, share);
  });
  ImageLossValue mean;
  for (const ImageLossValue& p : parts_) {
    mean.color += share * p.color;
    mean.silhouette += share * p.silhouette;
    mean.total += share * p.total;
  }
  return mean;
}

}  // namespace tilegrad::train
