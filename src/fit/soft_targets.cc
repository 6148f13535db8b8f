// SPDX-License-Identifier: Apache-2.0
#include "fit/soft_targets.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tilegrad::train {

SoftTargets::SoftTargets(TargetImages images, const Workers& workers)
    : images_(std::move(images)), distances_(images_.alpha.size() / images_.pixels()) {
  images_.silhouette.resize(images_.alpha.size());
  workers.For(distances_.size(), [&](std::size_t v, std::size_t) {
    const std::size_t plane = images_.pixels();
    distances_[v] = DistanceOf(std::span(images_.alpha).subspan(v * plane, plane), images_.width,
                               images_.height);
  });
}

const TargetImages& SoftTargets::At(double delta, std::span<const int> views,
                                    const Workers& workers) {
  const double ndc = 2.0 / std::max(images_.width, images_.height);
  const auto factor = static_cast<float>(ndc * ndc / delta);
  workers.For(views.size(), [&](std::size_t i, std::size_t) {
    const auto v = static_cast<std::size_t>(views[i]);
    const std::vector<float>& d = distances_[v].values;
    float* to = &images_.silhouette[v * images_.pixels()];
    for (std::size_t p = 0; p < d.size(); ++p)
      to[p] = d[p] >= 0 ? 1.0f : std::exp(-d[p] * d[p] * factor);
  });
  return images_;
}

}  // namespace tilegrad::train
