// SPDX-License-Identifier: Apache-2.0
#include "fit/texture_fill.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include "base/union_find.h"
#include "fit/unknowns.h"

namespace tilegrad::train {
namespace {

// Of one pair of texture coordinates, in texels: centres are at whole numbers, row 0 is v = 1.
glm::dvec2 TexelAt(const FitScene& scene, std::int32_t uv) {
  const auto at = 2 * static_cast<std::size_t>(uv);
  return {static_cast<double>(scene.uvs[at]) * scene.texture.width - 0.5,
          (1 - static_cast<double>(scene.uvs[at + 1])) * scene.texture.height - 0.5};
}

double Cross(glm::dvec2 a, glm::dvec2 b) { return a.x * b.y - a.y * b.x; }

constexpr float kLeastWeight = 1e-3f;  // of a texel in all pixels together: less is rounding
constexpr int kMostTiles = 16;         // a face that covers more of them covers each texel

// A texture as it is looked up: what lies beyond its border.
struct TexelGrid {
  int width, height;
  bool repeats;

  std::size_t count() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
  // The texel of any column and row, or -1.
  std::ptrdiff_t At(int x, int y) const {
    if (repeats) {
      x = (x % width + width) % width;
      y = (y % height + height) % height;
    } else if (x < 0 || y < 0 || x >= width || y >= height) {
      return -1;
    }
    return static_cast<std::ptrdiff_t>(y) * width + x;
  }
};

TexelGrid GridOf(const FitScene& scene) {
  return {scene.texture.width, scene.texture.height, scene.wrap == Wrap::kRepeat};
}

// Calls visit(column, row) for each texel centre in a triangle, its border included.
template <class Visit>
void ForEachTexel(const std::array<glm::dvec2, 3>& p, const TexelGrid& grid, const Visit& visit) {
  const auto [low_x, high_x] = std::minmax({p[0].x, p[1].x, p[2].x});
  const auto [low_y, high_y] = std::minmax({p[0].y, p[1].y, p[2].y});
  const bool near = high_x - low_x <= kMostTiles * grid.width &&
                    high_y - low_y <= kMostTiles * grid.height && std::abs(low_x) < 1e8 &&
                    std::abs(low_y) < 1e8;
  if (!near) return;
  const double area = Cross(p[1] - p[0], p[2] - p[0]), sign = area < 0 ? -1 : 1;
  for (int y = static_cast<int>(std::ceil(low_y)); y <= high_y; ++y) {
    for (int x = static_cast<int>(std::ceil(low_x)); x <= high_x; ++x) {
      const glm::dvec2 c(x, y);
      bool inside = area != 0;
      for (std::size_t k = 0; k < 3; ++k)
        inside &= sign * Cross(p[(k + 1) % 3] - p[k], c - p[k]) >= 0;
      if (inside) visit(x, y);
    }
  }
}

// Fills ring by ring.
class RingFill {
 public:
  RingFill(const TexelGrid& grid, const std::vector<bool>& seen, Image* texture)
      : grid_(grid), texture_(texture), done_(seen) {}

  // From texels with a colour on to those that `joins(texel, neighbour)` lets them colour.
  template <class Joins>
  void Run(const Joins& joins) {
    std::vector<std::size_t> open;
    for (std::size_t t = 0; t < grid_.count(); ++t) {
      if (!done_[t]) open.push_back(t);
    }
    while (!open.empty()) {
      ring_.clear();
      colors_.clear();
      rest_.clear();
      for (const std::size_t t : open) Visit(t, joins);
      if (ring_.empty()) return;
      for (std::size_t i = 0; i < ring_.size(); ++i) {
        std::copy_n(&colors_[3 * i], 3, &texture_->pixels[3 * ring_[i]]);
        done_[ring_[i]] = true;
      }
      open.swap(rest_);
    }
  }

 private:
  template <class Joins>
  void Visit(std::size_t texel, const Joins& joins) {
    std::array<float, 3> sum = {};
    int count = 0;
    const int x = static_cast<int>(texel) % grid_.width, y = static_cast<int>(texel) / grid_.width;
    for (int k = 0; k < 9; ++k) {
      const std::ptrdiff_t at = grid_.At(x + k % 3 - 1, y + k / 3 - 1);
      if (at < 0 || !done_[static_cast<std::size_t>(at)]) continue;
      if (!joins(texel, static_cast<std::size_t>(at))) continue;
      for (std::size_t c = 0; c < 3; ++c)
        sum[c] += texture_->pixels[3 * static_cast<std::size_t>(at) + c];
      ++count;
    }
    if (count == 0) return rest_.push_back(texel);
    ring_.push_back(texel);
    for (const float s : sum) colors_.push_back(s / static_cast<float>(count));
  }

  const TexelGrid grid_;
  Image* texture_;
  std::vector<bool> done_;
  std::vector<std::size_t> ring_, rest_;
  std::vector<float> colors_;
};

}  // namespace

Result<std::vector<bool>> SeenTexels(const FitScene& scene, std::span<const int> views,
                                     ImageSize size, const Workers& workers) {
  FitScene plain = scene;  // without light and colours, which may be 0, every texel has its weight
  plain.shading = {};
  plain.colors.clear();
  nn::Context context(workers);
  SceneRenderer renderer(workers);
  ParameterSet wanted;
  wanted[Parameter::kTexture] = true;
  const Unknowns unknowns(context, plain, wanted);
  const auto texels =
      std::ranges::find(unknowns.blocks(), Parameter::kTexture, &ParameterBlock::what);
  FitRenderer::Job job;
  job.options.width = size.width;
  job.options.height = size.height;
  job.alpha = false;
  std::vector<float> weight(scene.texture.pixels.size() / 3, 0.0f);
  for (const int view : views) {
    job.views = {&view, 1};
    const nn::Var sum = nn::Sum(unknowns.Render(&renderer, job).colors);
    const auto gradients = nn::Grad(sum, {texels->value});
    TILEGRAD_TRY(context.TakeStatus());
    const auto d = gradients[0].value().span<float>();
    for (std::size_t t = 0; t < weight.size(); ++t) weight[t] += d[3 * t];
  }
  std::vector<bool> seen(weight.size());
  std::transform(weight.begin(), weight.end(), seen.begin(),
                 [](float w) { return w > kLeastWeight; });
  return seen;
}

std::vector<std::int32_t> ChartsOfTexels(const FitScene& scene) {
  const TexelGrid grid = GridOf(scene);
  UnionFind charts(scene.uvs.size() / 2);
  const std::vector<std::int32_t>& uv = scene.uv_indices;
  for (std::size_t c = 0; c + 2 < uv.size(); c += 3) {
    charts.Join(uv[c], uv[c + 1]);
    charts.Join(uv[c], uv[c + 2]);
  }
  std::vector<std::int32_t> out(grid.count(), -1);
  for (std::size_t c = 0; c + 2 < uv.size(); c += 3) {
    const std::array corners = {TexelAt(scene, uv[c]), TexelAt(scene, uv[c + 1]),
                                TexelAt(scene, uv[c + 2])};
    const auto chart = static_cast<std::int32_t>(charts.Of(uv[c]));
    ForEachTexel(corners, grid, [&](int x, int y) {
      const std::ptrdiff_t at = grid.At(x, y);
      if (at >= 0) out[static_cast<std::size_t>(at)] = chart;
    });
  }
  return out;
}

void FillUnseenTexels(const std::vector<bool>& seen, FitScene* scene) {
  if (std::none_of(seen.begin(), seen.end(), [](bool s) { return s; })) return;
  const std::vector<std::int32_t> charts = ChartsOfTexels(*scene);
  RingFill fill(GridOf(*scene), seen, &scene->texture);
  fill.Run([&](std::size_t texel, std::size_t neighbour) {
    return charts[texel] >= 0 && charts[texel] == charts[neighbour];
  });
  fill.Run([](std::size_t, std::size_t) { return true; });
}

}  // namespace tilegrad::train
