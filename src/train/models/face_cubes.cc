// SPDX-License-Identifier: Apache-2.0
#include "train/models/face_cubes.h"

#include <algorithm>
#include <cmath>

#include "nn/nn.h"
#include "scene/sphere_uv.h"

namespace tilegrad::train {
namespace {

// Barycentric coordinates of a cube's texel.
glm::vec3 PlaceOf(std::int64_t texel) {
  const glm::vec3 p(texel >> 2 & 1, texel >> 1 & 1, texel & 1);
  const float sum = p.x + p.y + p.z;
  return sum > 0 ? p / sum : glm::vec3(1.0f / 3);
}

// The four texels around (u, v): u repeats, v is clamped.
void AddBilinear(glm::vec2 uv, std::int64_t side, nn::AxisTerms* terms) {
  const double x = static_cast<double>(uv.x) * static_cast<double>(side) - 0.5;
  const double y = (1 - static_cast<double>(uv.y)) * static_cast<double>(side) - 0.5;
  const double a = x - std::floor(x), b = y - std::floor(y);
  for (int k = 0; k < 4; ++k) {
    const auto column = static_cast<std::int64_t>(std::floor(x)) + k % 2;
    const auto row = static_cast<std::int64_t>(std::floor(y)) + k / 2;
    const std::int64_t i = std::clamp(row, std::int64_t{0}, side - 1);
    terms->push_back({i * side + (column % side + side) % side,
                      (k % 2 == 1 ? a : 1 - a) * (k / 2 == 1 ? b : 1 - b)});
  }
}

// What N3MR mixes at barycentric weights w of a face: each axis of the cube at w of its corner.
void AddMixture(std::int64_t face, const std::array<float, 3>& w, nn::AxisTerms* terms) {
  for (std::int64_t t = 0; t < FaceCubes::kTexels; ++t) {
    double weight = 1;
    for (int k = 0; k < 3; ++k) {
      const double share = w[static_cast<std::size_t>(k)];
      weight *= (t >> (2 - k) & 1) == 1 ? share : 1 - share;
    }
    terms->push_back({face * FaceCubes::kTexels + t, weight});
  }
}

nn::Var Cross(const nn::Var& a, const nn::Var& b) {
  const auto turned = [](const nn::Var& v, int by) {
    const int axis = v.shape().rank() - 1;
    return nn::Concat({nn::Slice(v, axis, by, 3), nn::Slice(v, axis, 0, by)}, axis);
  };
  return turned(a, 1) * turned(b, 2) - turned(a, 2) * turned(b, 1);
}

}  // namespace

FaceCubes::FaceCubes(nn::Context& context, const Mesh& sphere, int side)
    : side_(side), faces_(static_cast<std::int64_t>(sphere.faces.size())) {
  const nn::Var like = nn::Constant(context, 0.0);
  const std::vector<glm::vec2> uvs = SphereUvs(sphere);
  const std::int64_t texels = side_ * side_, cubes = faces_ * kTexels;
  to_cubes_ = nn::MakeAxisMap(like, {texels, cubes}, [&](std::int64_t i, nn::AxisTerms& terms) {
    const glm::vec3 w = PlaceOf(i % kTexels);
    const auto corner = static_cast<std::size_t>(3 * (i / kTexels));
    AddBilinear(w.x * uvs[corner] + w.y * uvs[corner + 1] + w.z * uvs[corner + 2], side_, &terms);
  });
  const std::vector<SurfacePoint> points = SphereTexels(sphere, side, side);
  to_maps_ = nn::MakeAxisMap(like, {cubes, texels}, [&](std::int64_t i, nn::AxisTerms& terms) {
    const SurfacePoint& at = points[static_cast<std::size_t>(i)];
    AddMixture(at.face, at.weights, &terms);
  });
}

nn::Var FaceCubes::Cubes(const nn::Var& textures) const {
  const std::int64_t batch = textures.shape()[0];
  const nn::Var flat = nn::Reshape(textures, {batch, side_ * side_, 3});
  return nn::Reshape(nn::MapAxis(flat, 1, to_cubes_), {batch, faces_, kTexels, 3});
}

nn::Var FaceCubes::Maps(const nn::Var& cubes) const {
  const std::int64_t batch = cubes.shape()[0];
  const nn::Var flat = nn::Reshape(cubes, {batch, faces_ * kTexels, 3});
  return nn::Reshape(nn::MapAxis(flat, 1, to_maps_), {batch, side_, side_, 3});
}

nn::Var FaceLight(const nn::Var& positions, const std::vector<Face>& faces,
                  const nn::Var& directions, double ambient) {
  if (!positions.valid() || !directions.valid()) return nn::Invalid({&positions, &directions});
  nn::Context& context = positions.context();
  const auto corner = [&](std::size_t k) {
    std::vector<std::int32_t> vertices;
    for (const Face& face : faces) vertices.push_back(face[k]);
    return nn::Gather(positions, 1, context.Indices(vertices));
  };
  const nn::Var a = corner(0);
  const nn::Var normal = Cross(corner(1) - a, corner(2) - a);
  const nn::Var length = nn::Sqrt(nn::Sum(nn::Square(normal), {2}, nn::Keep::kYes) + 1e-14);
  const std::int64_t images = positions.shape()[0], count = static_cast<std::int64_t>(faces.size());
  const nn::Var cosine =
      nn::Sum(normal * nn::Reshape(directions, {images, 1, 3}), {2}, nn::Keep::kYes) / length;
  return nn::Reshape(nn::Relu(cosine) + ambient, {images, count, 1, 1});
}

}  // namespace tilegrad::train
