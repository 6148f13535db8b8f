// SPDX-License-Identifier: Apache-2.0
#include "fit/hull/photo_views.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "scene/camera_conventions.h"

namespace tilegrad::train {
namespace {

constexpr int kLeastSide = 96;       // pixels: images are halved down to no less
constexpr float kStepCells = 1.0f;   // of the march along a ray
constexpr float kSlackCells = 2.0f;  // how far behind a view's depth it still sees a point
constexpr int kLeastOthers = 2;

TargetImages Smaller(const TargetImages& images) {
  int factor = 1;
  const auto halves = [&](int side) {
    return side % (2 * factor) == 0 && side / (2 * factor) >= kLeastSide;
  };
  while (halves(images.width) && halves(images.height)) factor *= 2;
  return factor == 1 ? images : Reduce(images, factor);
}

glm::vec3 CameraAxis(const Camera& camera, int i) {
  const float* r = camera.rotation + 3 * i;
  return {r[0], r[1], r[2]};
}

// To the world's axes.
glm::vec3 InWorld(const Camera& camera, glm::vec3 p) {
  return CameraAxis(camera, 0) * p.x + CameraAxis(camera, 1) * p.y + CameraAxis(camera, 2) * p.z;
}

glm::vec3 CameraCentre(const Camera& camera) {
  const float* t = camera.translation;
  return -InWorld(camera, {t[0], t[1], t[2]});
}

// Pixels, pixels, depth.
glm::vec3 ProjectInto(const Camera& camera, glm::vec3 p) {
  const float* t = camera.translation;
  const float depth = -(glm::dot(CameraAxis(camera, 2), p) + t[2]);
  return {camera.cx + camera.fx * (glm::dot(CameraAxis(camera, 0), p) + t[0]) / depth,
          camera.cy - camera.fy * (glm::dot(CameraAxis(camera, 1), p) + t[1]) / depth, depth};
}

// The depths between which a ray is in the grid; empty if first > second.
std::pair<float, float> DepthsWithin(const ScalarGrid& grid, glm::vec3 eye, glm::vec3 along) {
  const glm::vec3 high =
      grid.low + grid.cell * glm::vec3(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1);
  const glm::vec3 a = (grid.low - eye) / along, b = (high - eye) / along;
  const glm::vec3 near = glm::min(a, b), far = glm::max(a, b);
  return {std::max({near.x, near.y, near.z, 0.0f}), std::min({far.x, far.y, far.z})};
}

}  // namespace

float SampleGrid(const ScalarGrid& grid, glm::vec3 point) {
  const glm::vec3 at = (point - grid.low) / grid.cell, floor = glm::floor(at);
  for (int a = 0; a < 3; ++a)
    if (!(floor[a] >= 0 &&
          floor[a] < static_cast<float>(grid.size[static_cast<std::size_t>(a)] - 1)))
      return -grid.cell;
  const glm::vec3 f = at - floor;
  const float* v = &grid.values[grid.At(static_cast<int>(floor.x), static_cast<int>(floor.y),
                                        static_cast<int>(floor.z))];
  const std::size_t y = static_cast<std::size_t>(grid.size[2]),
                    x = y * static_cast<std::size_t>(grid.size[1]);
  const auto mix = [](float a, float b, float t) { return a + t * (b - a); };
  const auto along_y = [&](const float* p) {
    return mix(mix(p[0], p[1], f.z), mix(p[y], p[y + 1], f.z), f.y);
  };
  return mix(along_y(v), along_y(v + x), f.x);
}

PhotoViews::PhotoViews(const FitInput& input, const ScalarGrid& solid, const Workers& workers)
    : images_(Smaller(input.images)),
      views_(input.training.size()),
      slack_(kSlackCells * solid.cell) {
  const float factor = static_cast<float>(images_.width) / static_cast<float>(input.images.width);
  const std::size_t plane = images_.pixels();
  workers.For(views_.size(), [&](std::size_t i, std::size_t) {
    const auto v = static_cast<std::size_t>(input.training[i]);
    View& view = views_[i];
    view.camera = ScaledCamera(input.cameras[v], factor);
    view.eye = CameraCentre(view.camera);
    view.color = std::span(images_.color).subspan(3 * v * plane, 3 * plane);
    view.alpha = std::span(images_.outline()).subspan(v * plane, plane);
    view.depth.assign(plane, HUGE_VALF);
    for (std::uint32_t p = 0; p < plane; ++p)
      if (view.alpha[p] > 0.5f) view.depth[p] = March(view, p, 0, solid);
  });
}

std::vector<PhotoViews::Pixel> PhotoViews::Seeing() const {
  std::vector<Pixel> pixels;
  for (std::uint32_t v = 0; v < views_.size(); ++v)
    for (std::uint32_t p = 0; p < views_[v].depth.size(); ++p)
      if (std::isfinite(views_[v].depth[p])) pixels.push_back({v, p});
  return pixels;
}

void PhotoViews::Look(std::span<const Pixel> pixels, const ScalarGrid& solid,
                      const Workers& workers) {
  constexpr std::size_t kGrain = 256;
  workers.ForRanges(pixels.size(), kGrain, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t i = begin; i < end; ++i) {
      View& view = views_[pixels[i].view];
      float& depth = view.depth[pixels[i].at];
      depth = March(view, pixels[i].at, depth - slack_, solid);
    }
  });
}

std::vector<float> PhotoViews::Depths(std::span<const Pixel> pixels) const {
  std::vector<float> depths;
  for (const Pixel& p : pixels) depths.push_back(views_[p.view].depth[p.at]);
  return depths;
}

void PhotoViews::SetDepths(std::span<const Pixel> pixels, std::span<const float> depths) {
  for (std::size_t i = 0; i < pixels.size(); ++i)
    views_[pixels[i].view].depth[pixels[i].at] = depths[i];
}

glm::vec3 PhotoViews::PointOf(Pixel pixel, float further) const {
  const View& view = views_[pixel.view];
  const glm::vec3 along = Along(view, pixel.at);
  return view.eye + along * (view.depth[pixel.at] + further / glm::length(along));
}

void PhotoViews::Trace(Pixel pixel, float from, float to, float step,
                       FunctionRef<void(glm::vec3 point)> visit) const {
  const View& view = views_[pixel.view];
  const glm::vec3 along = Along(view, pixel.at);
  const float each = step / glm::length(along);
  for (float depth = from; depth < to; depth += each) visit(view.eye + along * depth);
}

std::vector<PhotoViews::Agreement> PhotoViews::Agree(std::span<const Pixel> pixels,
                                                     const Workers& workers) const {
  constexpr std::size_t kGrain = 64;
  std::vector<Agreement> out(pixels.size());
  workers.ForRanges(pixels.size(), kGrain, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t i = begin; i < end; ++i) out[i] = AgreeOn(pixels[i]);
  });
  return out;
}

// What a ray moves by for each unit of depth.
glm::vec3 PhotoViews::Along(const View& view, std::uint32_t at) const {
  const auto width = static_cast<std::uint32_t>(images_.width);
  const float x = static_cast<float>(at % width) + 0.5f, y = static_cast<float>(at / width) + 0.5f;
  const Camera& c = view.camera;
  return InWorld(c, {(x - c.cx) / c.fx, -(y - c.cy) / c.fy, -1});
}

// The first depth beyond `from` at which the ray is in the solid.
float PhotoViews::March(const View& view, std::uint32_t at, float from,
                        const ScalarGrid& solid) const {
  const glm::vec3 along = Along(view, at);
  const auto [near, far] = DepthsWithin(solid, view.eye, along);
  const float step = kStepCells * solid.cell / glm::length(along);
  float before = -solid.cell;
  for (float depth = std::max(near, from); depth <= far; depth += step) {
    const float value = SampleGrid(solid, view.eye + along * depth);
    if (value > 0) return depth - step * value / (value - before);
    before = std::min(value, -1e-6f * solid.cell);
  }
  return HUGE_VALF;
}

bool PhotoViews::Sees(const View& view, glm::vec3 point, glm::vec3* color) const {
  const glm::vec3 at = ProjectInto(view.camera, point);
  const float x = at.x - 0.5f, y = at.y - 0.5f;
  if (!(at.z > 0 && x >= 0 && y >= 0 && x < static_cast<float>(images_.width - 1) &&
        y < static_cast<float>(images_.height - 1)))
    return false;
  const auto width = static_cast<std::size_t>(images_.width);
  const std::size_t nearest =
      static_cast<std::size_t>(at.y) * width + static_cast<std::size_t>(at.x);
  if (!(view.alpha[nearest] > 0.5f && at.z <= view.depth[nearest] + slack_)) return false;
  const auto column = static_cast<std::size_t>(x), row = static_cast<std::size_t>(y);
  const float u = x - static_cast<float>(column), v = y - static_cast<float>(row);
  const std::size_t corner = row * width + column, plane = images_.pixels();
  for (int c = 0; c < 3; ++c) {
    const float* p = &view.color[static_cast<std::size_t>(c) * plane + corner];
    (*color)[c] =
        (1 - v) * ((1 - u) * p[0] + u * p[1]) + v * ((1 - u) * p[width] + u * p[width + 1]);
  }
  return true;
}

PhotoViews::Agreement PhotoViews::AgreeOn(Pixel pixel) const {
  const View& view = views_[pixel.view];
  if (!std::isfinite(view.depth[pixel.at])) return {1, true};
  const glm::vec3 point = PointOf(pixel);
  glm::vec3 sum(0), color;
  int others = 0;
  for (std::uint32_t v = 0; v < views_.size(); ++v) {
    if (v == pixel.view || !Sees(views_[v], point, &color)) continue;
    sum += color;
    ++others;
  }
  if (others < kLeastOthers) return {};
  const std::size_t plane = images_.pixels();
  const glm::vec3 own(view.color[pixel.at], view.color[plane + pixel.at],
                      view.color[2 * plane + pixel.at]);
  const glm::vec3 away = glm::abs(own - sum / static_cast<float>(others));
  return {std::min((away.x + away.y + away.z) / 3, kMost), true};
}

}  // namespace tilegrad::train
