// SPDX-License-Identifier: Apache-2.0
#include "fit/hull/mask_distance.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "base/whole_number.h"

namespace tilegrad::train {
namespace {

constexpr float kHalf = 0.5f;  // alpha at the outline
constexpr float kFar = 1e6f;   // pixels

struct Point {
  float x = kFar, y = kFar;
};

class Propagation {
 public:
  Propagation(std::span<const float> alpha, int width, int height)
      : alpha_(alpha), width_(width), height_(height), nearest_(alpha.size()) {}

  MaskDistance Run() {
    SetOutline();
    for (int y = 0; y < height_; ++y) PassRow(y, -1);
    for (int y = height_ - 1; y >= 0; --y) PassRow(y, 1);
    MaskDistance out{width_, height_, std::vector<float>(alpha_.size())};
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        const std::size_t i = At(x, y);
        const float d = std::min(kFar, std::sqrt(Square(nearest_[i], x, y)));
        out.values[i] = alpha_[i] >= kHalf ? d : -d;
      }
    }
    return out;
  }

 private:
  std::size_t At(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }
  static float Square(const Point& p, int x, int y) {
    const float dx = p.x - static_cast<float>(x), dy = p.y - static_cast<float>(y);
    return dx * dx + dy * dy;
  }
  void Offer(const Point& p, int x, int y) {
    Point& known = nearest_[At(x, y)];
    if (Square(p, x, y) < Square(known, x, y)) known = p;
  }

  // Points of the outline between neighbours, offered to both.
  void SetOutline() {
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        if (x + 1 < width_) Cross(x, y, 1, 0);
        if (y + 1 < height_) Cross(x, y, 0, 1);
      }
    }
  }
  void Cross(int x, int y, int dx, int dy) {
    const float a = alpha_[At(x, y)], b = alpha_[At(x + dx, y + dy)];
    if ((a >= kHalf) == (b >= kHalf)) return;
    const float t = (kHalf - a) / (b - a);
    const Point p{static_cast<float>(x) + t * static_cast<float>(dx),
                  static_cast<float>(y) + t * static_cast<float>(dy)};
    Offer(p, x, y);
    Offer(p, x + dx, y + dy);
  }

  // What the row before (`from`: -1 above, 1 below) and the neighbours in the row know.
  void PassRow(int y, int from) {
    const int before = y + from;
    for (int x = 0; x < width_; ++x) {
      if (before >= 0 && before < height_) {
        for (int dx = -1; dx <= 1; ++dx) Ask(x, y, x + dx, before);
      }
      Ask(x, y, x - 1, y);
    }
    for (int x = width_ - 1; x >= 0; --x) Ask(x, y, x + 1, y);
  }
  void Ask(int x, int y, int other_x, int other_y) {
    if (other_x >= 0 && other_x < width_) Offer(nearest_[At(other_x, other_y)], x, y);
  }

  std::span<const float> alpha_;
  int width_, height_;
  std::vector<Point> nearest_;
};

}  // namespace

float MaskDistance::At(float x, float y) const {
  if (!std::isfinite(x) || !std::isfinite(y)) return -HUGE_VALF;
  x -= 0.5f;
  y -= 0.5f;
  const float in_x = std::clamp(x, 0.0f, static_cast<float>(width - 1)),
              in_y = std::clamp(y, 0.0f, static_cast<float>(height - 1));
  const int x0 = std::min(WholeNumber<int>(in_x), std::max(0, width - 2)),
            y0 = std::min(WholeNumber<int>(in_y), std::max(0, height - 2));
  const int x1 = std::min(x0 + 1, width - 1), y1 = std::min(y0 + 1, height - 1);
  const float fx = in_x - static_cast<float>(x0), fy = in_y - static_cast<float>(y0);
  const auto value = [&](int column, int row) {
    return values[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(column)];
  };
  const float top = value(x0, y0) + fx * (value(x1, y0) - value(x0, y0));
  const float low = value(x0, y1) + fx * (value(x1, y1) - value(x0, y1));
  const float inside = top + fy * (low - top);
  return inside > 0 ? inside : inside - std::hypot(x - in_x, y - in_y);
}

MaskDistance DistanceOf(std::span<const float> alpha, int width, int height) {
  return Propagation(alpha, width, height).Run();
}

}  // namespace tilegrad::train
