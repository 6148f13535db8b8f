// SPDX-License-Identifier: Apache-2.0
#include "fit/masks/common_hull.h"

#include <algorithm>
#include <cmath>

namespace tilegrad::train {
namespace {

constexpr double kUnseen = 0.25;     // share of the views that may lack a cell
constexpr float kSharpness = 80;     // of the vote, over shares of views
constexpr float kCellSlack = 0.25f;  // pixels that a cell is drawn larger on each side
constexpr float kLeastFull = 0.02f;  // cells below draw nothing

bool IsIn(ImageSize size, float x, float y) {
  return x >= 0 && y >= 0 && x < static_cast<float>(size.width) &&
         y < static_cast<float>(size.height);
}

}  // namespace

CommonHull::Place CommonHull::Project(std::size_t view, glm::vec3 p) const {
  const Camera& c = cameras_[view];
  const float *r = c.rotation, *t = c.translation;
  const float x = r[0] * p.x + r[1] * p.y + r[2] * p.z + t[0];
  const float y = r[3] * p.x + r[4] * p.y + r[5] * p.z + t[1];
  const float depth = -(r[6] * p.x + r[7] * p.y + r[8] * p.z + t[2]);
  if (!(depth > c.near_plane)) return {-1, -1, depth};
  return {c.cx + c.fx * x / depth, c.cy - c.fy * y / depth, depth};
}

glm::vec3 CommonHull::Centre(std::size_t cell) const {
  const auto x = static_cast<float>(cell / (kSide * kSide)),
             y = static_cast<float>(cell / kSide % kSide), z = static_cast<float>(cell % kSide);
  return low_ + cell_ * (glm::vec3(x, y, z) + 0.5f);
}

CommonHull::CommonHull(std::span<const Camera> cameras, ImageSize size, glm::vec3 middle,
                       const Workers& workers)
    : cameras_(cameras.begin(), cameras.end()),
      size_(size),
      full_(std::size_t{kSide} * kSide * kSide) {
  std::vector<float> reach;  // half of what a view sees at the middle
  const auto longest = static_cast<float>(std::max(size.width, size.height));
  for (std::size_t v = 0; v < cameras_.size(); ++v)
    reach.push_back(0.5f * longest * std::abs(Project(v, middle).depth / cameras_[v].fx));
  std::ranges::sort(reach);
  cell_ = 2 * reach[reach.size() / 2] / kSide;
  low_ = middle - 0.5f * cell_ * kSide;
  std::vector<char> possible(full_.size());
  workers.For(kSide, [&](std::size_t x, std::size_t) {
    for (std::size_t i = x * kSide * kSide; i < (x + 1) * kSide * kSide; ++i) {
      std::size_t unseen = 0;
      for (std::size_t v = 0; v < cameras_.size(); ++v) {
        const Place at = Project(v, Centre(i));
        unseen += !IsIn(size_, at.x, at.y);
      }
      possible[i] = static_cast<double>(unseen) <= kUnseen * static_cast<double>(cameras_.size());
    }
  });
  possible_.assign(possible.begin(), possible.end());
}

void CommonHull::Vote(std::span<const float> inside, double tolerance, const Workers& workers) {
  const auto wide = static_cast<std::size_t>(size_.width);
  const std::size_t plane = wide * static_cast<std::size_t>(size_.height);
  workers.For(kSide, [&](std::size_t x, std::size_t) {
    for (std::size_t i = x * kSide * kSide; i < (x + 1) * kSide * kSide; ++i) {
      full_[i] = 0;
      if (!possible_[i]) continue;
      float against = 0;
      for (std::size_t v = 0; v < cameras_.size(); ++v) {
        const Place at = Project(v, Centre(i));
        if (!IsIn(size_, at.x, at.y)) continue;
        const std::size_t p =
            static_cast<std::size_t>(at.y) * wide + static_cast<std::size_t>(at.x);
        against += 1 - inside[v * plane + p];
      }
      const float share = against / static_cast<float>(cameras_.size());
      full_[i] = 1 / (1 + std::exp(kSharpness * (share - static_cast<float>(tolerance))));
    }
  });
}

std::vector<float> CommonHull::Silhouette(std::size_t view) const {
  const auto wide = static_cast<std::size_t>(size_.width);
  std::vector<float> out(wide * static_cast<std::size_t>(size_.height));
  for (std::size_t i = 0; i < full_.size(); ++i) {
    if (full_[i] < kLeastFull) continue;
    const Place at = Project(view, Centre(i));
    if (!IsIn(size_, at.x, at.y)) continue;
    const float half = std::min(0.5f * cell_ * std::abs(cameras_[view].fx) / at.depth + kCellSlack,
                                static_cast<float>(std::max(size_.width, size_.height)));
    const int left = std::max(0, static_cast<int>(at.x - half)),
              right = std::min(size_.width - 1, static_cast<int>(at.x + half)),
              top = std::max(0, static_cast<int>(at.y - half)),
              bottom = std::min(size_.height - 1, static_cast<int>(at.y + half));
    for (int y = top; y <= bottom; ++y) {
      for (int x = left; x <= right; ++x) {
        float& pixel = out[static_cast<std::size_t>(y) * wide + static_cast<std::size_t>(x)];
        pixel = std::max(pixel, full_[i]);
      }
    }
  }
  return out;
}

}  // namespace tilegrad::train
