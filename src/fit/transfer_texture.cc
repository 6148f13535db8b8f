// SPDX-License-Identifier: Apache-2.0
#include "fit/transfer_texture.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include "base/whole_number.h"
#include "fit/texels.h"
#include "train/metrics/face_tree.h"

namespace tilegrad::train {
namespace {

std::size_t Index(std::int32_t i) { return static_cast<std::size_t>(i); }

Triangle CornersOf(const FitScene& scene, std::size_t face) {
  Triangle out;
  for (std::size_t k = 0; k < 3; ++k) {
    const float* p = &scene.positions[3 * Index(scene.faces[3 * face + k])];
    out[k] = {p[0], p[1], p[2]};
  }
  return out;
}

// The point of a surface that a texel's centre shows.
struct SurfacePoint {
  std::size_t texel;
  glm::dvec3 at;
};

void AddSurfacePoints(const FitScene& scene, std::size_t face, std::vector<SurfacePoint>* out) {
  const Triangle corners = CornersOf(scene, face);
  const std::int32_t* uvs = &scene.uv_indices[3 * face];
  const glm::dvec2 p[3] = {TexelAt(scene, uvs[0]), TexelAt(scene, uvs[1]), TexelAt(scene, uvs[2])};
  const double area = Cross(p[1] - p[0], p[2] - p[0]);
  if (!(std::abs(area) > 0)) return;
  const auto from = [](double a, double b, double c) {
    return std::max(0, WholeNumber<int>(std::ceil(std::min({a, b, c}))));
  };
  const auto to = [](double a, double b, double c, int size) {
    return std::min(size - 1, WholeNumber<int>(std::floor(std::max({a, b, c}))));
  };
  const int last_y = to(p[0].y, p[1].y, p[2].y, scene.texture.height),
            last_x = to(p[0].x, p[1].x, p[2].x, scene.texture.width);
  for (int y = from(p[0].y, p[1].y, p[2].y); y <= last_y; ++y) {
    for (int x = from(p[0].x, p[1].x, p[2].x); x <= last_x; ++x) {
      const glm::dvec2 c(x, y);
      const double a = Cross(p[1] - c, p[2] - c) / area, b = Cross(p[2] - c, p[0] - c) / area;
      if (a < 0 || b < 0 || a + b > 1) continue;
      const auto texel =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(scene.texture.width) +
          static_cast<std::size_t>(x);
      out->push_back({texel, a * corners[0] + b * corners[1] + (1 - a - b) * corners[2]});
    }
  }
}

// Four texels and their weights.
struct Lookup {
  std::size_t texels[4];
  float weights[4];
};

Lookup LookupAt(const FitScene& scene, const FaceTree::Nearest& nearest) {
  glm::dvec2 at(0);
  for (std::size_t k = 0; k < 3; ++k)
    at += nearest.weights[k] * TexelAt(scene, scene.uv_indices[3 * Index(nearest.face) + k]);
  const int width = scene.texture.width, height = scene.texture.height;
  at.x = std::clamp(at.x, 0.0, width - 1.0);
  at.y = std::clamp(at.y, 0.0, height - 1.0);
  const int x = std::min(WholeNumber<int>(at.x), std::max(0, width - 2)),
            y = std::min(WholeNumber<int>(at.y), std::max(0, height - 2));
  const auto fx = static_cast<float>(at.x - x), fy = static_cast<float>(at.y - y);
  const auto first = static_cast<std::size_t>(y * width + x);
  const std::size_t right = width > 1 ? 1 : 0,
                    down = height > 1 ? static_cast<std::size_t>(width) : 0;
  return {{first, first + right, first + down, first + down + right},
          {(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy}};
}

}  // namespace

std::vector<bool> TransferTexels(const FitScene& from, const FitScene& to, const Workers& workers,
                                 std::span<AlignedVector<float>* const> arrays) {
  std::vector<SurfacePoint> places;
  for (std::size_t f = 0; 3 * f < to.faces.size(); ++f) AddSurfacePoints(to, f, &places);
  std::vector<Triangle> surface;
  for (std::size_t f = 0; 3 * f < from.faces.size(); ++f) surface.push_back(CornersOf(from, f));
  const FaceTree tree(surface);
  std::vector<Lookup> lookups(places.size());
  constexpr std::size_t kGrain = 256;
  workers.ForRanges(places.size(), kGrain, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t i = begin; i < end; ++i) lookups[i] = LookupAt(from, tree.Find(places[i].at));
  });
  std::vector<bool> set(to.texture.pixels.size() / 3, false);
  for (AlignedVector<float>* const array : arrays) {
    AlignedVector<float> moved(array->size(), 0.0f);
    for (std::size_t i = 0; i < places.size(); ++i) {
      set[places[i].texel] = true;
      for (std::size_t c = 0; c < 3; ++c) {
        float sum = 0;
        for (std::size_t k = 0; k < 4; ++k)
          sum += lookups[i].weights[k] * (*array)[3 * lookups[i].texels[k] + c];
        moved[3 * places[i].texel + c] = sum;
      }
    }
    array->swap(moved);
  }
  return set;
}

}  // namespace tilegrad::train
