// SPDX-License-Identifier: Apache-2.0
// The geometry of the yardstick, which the counting of work shares. Only for files compiled like
// culled.cc: inline functions of files with other flags could be taken instead.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "raster/culled.h"

namespace tilegrad::bench::plain {

struct Point {
  float x, y;
};
inline Point operator-(Point a, Point b) { return {a.x - b.x, a.y - b.y}; }
inline float Cross(Point a, Point b) { return a.x * b.y - a.y * b.x; }
inline float Dot(Point a, Point b) { return a.x * b.x + a.y * b.y; }

struct Triangle {
  Point v[3];
  std::int32_t id[3];
};

inline Triangle FaceAt(const CulledScene& scene, std::size_t face) {
  Triangle t;
  for (std::size_t k = 0; k < 3; ++k) {
    t.id[k] = scene.faces[3 * face + k];
    const auto at = 2 * static_cast<std::size_t>(t.id[k]);
    t.v[k] = {scene.ndc[at], scene.ndc[at + 1]};
  }
  return t;
}

struct Box {
  int x0, y0, x1, y1;
};

// Pixels whose centre is within `reach` of the face's box.
inline Box BoxOf(const CulledScene& scene, const Triangle& t, float reach) {
  const auto [left, right] = std::minmax({t.v[0].x, t.v[1].x, t.v[2].x});
  const auto [low, high] = std::minmax({t.v[0].y, t.v[1].y, t.v[2].y});
  const auto w = static_cast<float>(scene.width), h = static_cast<float>(scene.height);
  const auto clamp = [](float v, float size) {
    return static_cast<int>(std::min(std::max(v, 0.0f), size));
  };
  return {clamp(std::ceil((left - reach + 1) * w / 2 - 0.5f), w),
          clamp(std::ceil((1 - high - reach) * h / 2 - 0.5f), h),
          clamp(std::floor((right + reach + 1) * w / 2 - 0.5f) + 1, w),
          clamp(std::floor((1 - low + reach) * h / 2 - 0.5f) + 1, h)};
}

// Calls visit(pixel, centre) for the pixels of a box.
template <class Visit>
void ForPixels(const CulledScene& scene, const Box& box, const Visit& visit) {
  for (int j = box.y0; j < box.y1; ++j) {
    const float y = 1 - static_cast<float>(2 * j + 1) / static_cast<float>(scene.height);
    for (int i = box.x0; i < box.x1; ++i) {
      const float x = static_cast<float>(2 * i + 1) / static_cast<float>(scene.width) - 1;
      visit(static_cast<std::size_t>(j * scene.width + i), Point{x, y});
    }
  }
}

inline Box WholeImage(const CulledScene& scene) { return {0, 0, scene.width, scene.height}; }

inline float Reach(const CulledScene& scene) { return std::sqrt(17.33f * scene.delta); }

// Equations 2 and 3; false outside.
inline bool Weights(const Triangle& t, float inverse_area, Point p, float w[3]) {
  const Point a = t.v[0] - p, b = t.v[1] - p, c = t.v[2] - p;
  w[0] = Cross(b, c) * inverse_area;
  w[1] = Cross(c, a) * inverse_area;
  w[2] = Cross(a, b) * inverse_area;
  return w[0] >= 0 && w[1] >= 0 && w[2] >= 0;
}

// The nearest point of a face's boundary: on edge `edge`, at `along` of it.
struct Nearest {
  int edge;
  float along, squared;
};

inline Nearest NearestOf(const Triangle& t, Point p) {
  Nearest best{0, 0, std::numeric_limits<float>::max()};
  for (int k = 0; k < 3; ++k) {
    const Point a = t.v[k], e = t.v[(k + 1) % 3] - a, q = p - a;
    const float length = Dot(e, e);
    const float along = length > 0 ? std::clamp(Dot(q, e) / length, 0.0f, 1.0f) : 0.0f;
    const Point r{q.x - along * e.x, q.y - along * e.y};
    const float squared = Dot(r, r);
    if (squared < best.squared) best = {k, along, squared};
  }
  return best;
}

}  // namespace tilegrad::bench::plain
