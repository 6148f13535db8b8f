// SPDX-License-Identifier: Apache-2.0
#include "train/models/picture_lookup.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace tilegrad::train {
namespace {

// Where the numbers of Pose are 0, and what 1 is.
constexpr double kScale = 0.75, kNearness = 0.6;
constexpr double kShiftUnit = 0.1, kScaleUnit = 0.1, kNearnessUnit = 0.5;
constexpr double kLeastDepth = 0.2;  // of the distance: nothing is nearer
constexpr double kLeastCover = 0.3;  // colours are not divided by less
constexpr double kLeastLight = 0.25;

// A pose as it is used.
struct View {
  glm::dvec3 right, up, back;  // rows of the rotation
  double x, y, scale, nearness;

  template <class T>
  explicit View(const T* p)
      : right(p[0], p[1], p[2]),
        up(p[3], p[4], p[5]),
        x(0.5 + kShiftUnit * static_cast<double>(p[6])),
        y(0.5 + kShiftUnit * static_cast<double>(p[7])),
        scale(kScale + kScaleUnit * static_cast<double>(p[8])),
        nearness(std::max(0.0, kNearness + kNearnessUnit * static_cast<double>(p[9]))) {
    right /= glm::length(right) + 1e-9;
    up -= glm::dot(up, right) * right;
    up /= glm::length(up) + 1e-9;
    back = glm::cross(right, up);
  }
  glm::dvec3 Turned(const glm::dvec3& v) const {
    return {glm::dot(right, v), glm::dot(up, v), glm::dot(back, v)};
  }
};

// What a picture shows at (x, y), in [0, 1] from its upper left corner; nothing beyond its edges.
template <class T>
std::array<double, 4> SampleAt(const T* image, std::int64_t size, double x, double y) {
  std::array<double, 4> out = {};
  const double column = x * static_cast<double>(size) - 0.5;
  const double row = y * static_cast<double>(size) - 0.5;
  if (!(column > -1 && row > -1 && column < static_cast<double>(size) &&
        row < static_cast<double>(size)))
    return out;
  const double left = std::floor(column), top = std::floor(row);
  const double a = column - left, b = row - top;
  for (int k = 0; k < 4; ++k) {
    const std::int64_t i = static_cast<std::int64_t>(top) + k / 2;
    const std::int64_t j = static_cast<std::int64_t>(left) + k % 2;
    if (i < 0 || j < 0 || i >= size || j >= size) continue;
    const double weight = (k % 2 == 1 ? a : 1 - a) * (k / 2 == 1 ? b : 1 - b);
    for (std::int64_t c = 0; c < 4; ++c)
      out[static_cast<std::size_t>(c)] +=
          weight * static_cast<double>(image[(c * size + i) * size + j]);
  }
  return out;
}

// Sums of face normals that are as long as their faces are large.
template <class T>
std::vector<glm::dvec3> SmoothNormals(const std::vector<Face>& faces, const T* p,
                                      std::size_t vertices) {
  std::vector<glm::dvec3> normals(vertices, glm::dvec3(0));
  const auto at = [p](std::int32_t v) { return glm::dvec3(p[3 * v], p[3 * v + 1], p[3 * v + 2]); };
  for (const Face& f : faces) {
    const glm::dvec3 a = at(f[0]);
    const glm::dvec3 normal = glm::cross(at(f[1]) - a, at(f[2]) - a);
    for (const std::int32_t v : f) normals[static_cast<std::size_t>(v)] += normal;
  }
  return normals;
}

}  // namespace

Pose PoseOf(const Camera& camera, int size) {
  Pose pose;
  for (std::size_t i = 0; i < 6; ++i) pose[i] = static_cast<double>(camera.rotation[i]);
  const double distance = -static_cast<double>(camera.translation[2]);
  // A shift of the origin along the image is one of the principal point.
  const double x = (camera.cx + camera.fx * camera.translation[0] / distance) / size;
  const double y = (camera.cy - camera.fy * camera.translation[1] / distance) / size;
  pose[6] = (x - 0.5) / kShiftUnit, pose[7] = (y - 0.5) / kShiftUnit;
  pose[8] = (camera.fx / distance / size - kScale) / kScaleUnit;
  pose[9] = (1 / distance - kNearness) / kNearnessUnit;
  return pose;
}

PictureLookup::PictureLookup(const Mesh& sphere, int side)
    : side_(static_cast<std::size_t>(side)),
      faces_(sphere.faces),
      texels_(SphereTexels(sphere, side, side)) {}

template <class T>
void PictureLookup::LookAt(const Job& job, std::size_t m, std::size_t channels, T* out) const {
  const std::int64_t size = job.images.shape()[3];
  const auto vertices = static_cast<std::size_t>(job.positions.shape()[1]);
  const T* image = job.images.data<T>() + m * static_cast<std::size_t>(4 * size * size);
  const T* p = job.positions.data<T>() + 3 * vertices * m;
  const View view(job.pose.data<T>() + kPoseNumbers * m);
  const T* l = job.light.empty() ? nullptr : job.light.data<T>() + 3 * m;
  const std::vector<glm::dvec3> normals = SmoothNormals(faces_, p, vertices);
  const std::size_t plane = side_ * side_;
  for (std::size_t t = 0; t < plane; ++t) {
    const auto& [corners, weights] = texels_[t];
    glm::dvec3 x(0), n(0);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto v = static_cast<std::size_t>(corners[k]);
      x += static_cast<double>(weights[k]) * glm::dvec3(p[3 * v], p[3 * v + 1], p[3 * v + 2]);
      n += static_cast<double>(weights[k]) * normals[v];
    }
    x = view.Turned(x), n = view.Turned(n);
    n /= glm::length(n) + 1e-12;
    // In units of the camera's distance: depth 1 at the origin.
    const double depth = std::max(kLeastDepth, 1 - view.nearness * x.z);
    const auto seen =
        SampleAt(image, size, view.x + view.scale * x.x / depth, view.y - view.scale * x.y / depth);
    const glm::dvec3 eye(-view.nearness * x.x, -view.nearness * x.y, depth);
    const double lit =
        l == nullptr ? 1.0 : std::max(kLeastLight, glm::dot(n, glm::dvec3(l[0], l[1], l[2])));
    const double values[kChannels] = {
        seen[0] / std::max(kLeastCover, seen[3]), seen[1] / std::max(kLeastCover, seen[3]),
        seen[2] / std::max(kLeastCover, seen[3]), seen[3],
        glm::dot(n, eye) / glm::length(eye),      -std::log(lit)};
    // The mirror image of column j is side / 2 - 1 - j, as scene/sphere_uv.h says.
    const std::size_t j = t % side_, other = t - j + (side_ + side_ / 2 - 1 - j) % side_;
    for (std::size_t c = 0; c < channels; ++c) {
      out[c * plane + t] = static_cast<T>(values[c]);
      out[(channels + c) * plane + other] = static_cast<T>(values[c]);
    }
  }
}

nn::Tensor PictureLookup::Run(nn::Context& context, const Job& job, std::int64_t channels) const {
  const std::int64_t images = job.images.shape()[0], side = static_cast<std::int64_t>(side_);
  nn::Tensor out = context.Empty({images, 2 * channels, side, side}, job.images.dtype());
  nn::WithFloatType(out.dtype(), [&]<class T>(T) {
    const std::size_t numbers = static_cast<std::size_t>(2 * channels) * side_ * side_;
    context.workers().For(static_cast<std::size_t>(images), [&](std::size_t m, std::size_t) {
      LookAt<T>(job, m, static_cast<std::size_t>(channels), out.data<T>() + m * numbers);
    });
  });
  return out;
}

nn::Tensor PictureLookup::Look(nn::Context& context, const Job& job) const {
  return Run(context, job, kChannels);
}

nn::Tensor PictureLookup::Colors(nn::Context& context, const Job& job) const {
  return Run(context, job, 3);
}

}  // namespace tilegrad::train
