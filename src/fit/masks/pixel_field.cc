// SPDX-License-Identifier: Apache-2.0
#include "fit/masks/pixel_field.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tilegrad::train {
namespace {

constexpr float kLeastVariance = 2e-4f;  // of the difference of neighbours' colours: noise
constexpr float kDiagonal = 1 / std::numbers::sqrt2_v<float>;

}  // namespace

std::size_t PixelField::At(int x, int y) const {
  return static_cast<std::size_t>(y + 1) * stride_ + static_cast<std::size_t>(x + 1);
}

PixelField::PixelField(std::span<const float> color, int width, int height)
    : width_(width), height_(height), stride_(static_cast<std::size_t>(width) + 2) {
  const std::size_t plane = color.size() / 3;
  const auto between = [&](int x, int y, int u, int v) {
    const std::size_t p = static_cast<std::size_t>(y * width + x),
                      q = static_cast<std::size_t>(v * width + u);
    float sum = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const float d = color[c * plane + p] - color[c * plane + q];
      sum += d * d;
    }
    return sum;
  };
  double total = 0;
  const auto fill = [&](int dx, int dy, std::vector<float>* to) {
    to->assign(stride_ * static_cast<std::size_t>(height + 2), 0.0f);
    for (int y = 0; y + dy < height; ++y) {
      for (int x = std::max(0, -dx); x < width - std::max(0, dx); ++x) {
        const float d = between(x, y, x + dx, y + dy);
        total += static_cast<double>(d);
        (*to)[At(x, y)] = d;
      }
    }
  };
  fill(1, 0, &right_);
  fill(0, 1, &below_);
  fill(1, 1, &below_right_);
  fill(-1, 1, &below_left_);
  const float variance =
      std::max(static_cast<float>(total / (4 * static_cast<double>(plane))), kLeastVariance);
  const auto couple = [&](int dx, int dy, float weight, std::vector<float>* to) {
    for (int y = 0; y + dy < height; ++y)
      for (int x = std::max(0, -dx); x < width - std::max(0, dx); ++x)
        (*to)[At(x, y)] = weight * std::exp(-(*to)[At(x, y)] / (2 * variance));
  };
  couple(1, 0, 1, &right_);
  couple(0, 1, 1, &below_);
  couple(1, 1, kDiagonal, &below_right_);
  couple(-1, 1, kDiagonal, &below_left_);
}

std::vector<float> PixelField::Relax(std::span<const float> odds, const Relaxing& how) const {
  // Means of +1 inside and -1 outside, within a border of zeros.
  std::vector<float> mean(right_.size()), next(right_.size());
  const std::size_t s = stride_;
  const auto wide = static_cast<std::size_t>(width_);
  for (int round = 0; round <= how.rounds; ++round) {
    const float k = how.coupling * static_cast<float>(round) / static_cast<float>(how.rounds);
    const float* m = mean.data();
    for (int y = 0; y < height_; ++y) {
      const std::size_t row = At(0, y);
      const float* own = &odds[static_cast<std::size_t>(y) * wide];
      for (std::size_t x = 0; x < wide; ++x) {
        const std::size_t p = row + x;
        const float near = right_[p] * m[p + 1] + right_[p - 1] * m[p - 1] + below_[p] * m[p + s] +
                           below_[p - s] * m[p - s];
        const float across = below_right_[p] * m[p + s + 1] +
                             below_right_[p - s - 1] * m[p - s - 1] +
                             below_left_[p] * m[p + s - 1] + below_left_[p - s + 1] * m[p - s + 1];
        const float a = own[x] + k * (near + across);
        next[p] = a / std::sqrt(4 + a * a);  // as tanh(a / 2), without its cost
      }
    }
    mean.swap(next);
  }
  std::vector<float> out(odds.size());
  for (std::size_t p = 0; p < out.size(); ++p)
    out[p] = 0.5f + 0.5f * mean[At(static_cast<int>(p % wide), static_cast<int>(p / wide))];
  return out;
}

}  // namespace tilegrad::train
