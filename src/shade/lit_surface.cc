// SPDX-License-Identifier: Apache-2.0
#include "shade/lit_surface.h"

#include <algorithm>
#include <glm/geometric.hpp>

#include "shade/lambert_ref.h"

namespace tilegrad::shade {
namespace {

constexpr float kAmbient = 0.45f, kKey = 0.45f, kFill = 0.2f;

Light MakeLight(glm::vec3 towards, float intensity) {
  const glm::vec3 d = glm::normalize(towards);
  return {{d.x, d.y, d.z}, intensity};
}

const std::array<Light, 2>& Lights() {
  static const std::array<Light, 2> lights = {MakeLight({0.35f, 0.8f, 0.5f}, kKey),
                                              MakeLight({-0.6f, 0.3f, -0.75f}, kFill)};
  return lights;
}

glm::vec3 FaceNormal(const Mesh& mesh, std::size_t f) {
  const auto corner = [&](std::size_t k) {
    return mesh.positions[static_cast<std::size_t>(mesh.faces[f][k])];
  };
  const glm::vec3 a = corner(0);
  return glm::cross(corner(1) - a, corner(2) - a);
}

glm::vec3 UnitOr(glm::vec3 v, glm::vec3 otherwise) {
  const float length = glm::length(v);
  return length > 0 ? v / length : otherwise;
}

// The normal of corner k of face f, flipped to the side of the face's winding: normals in files
// point to either side.
glm::vec3 CornerNormal(const Mesh& mesh, std::size_t f, std::size_t k, glm::vec3 face_normal) {
  glm::vec3 n = face_normal;
  if (!mesh.corner_normals.empty()) {
    n = mesh.corner_normals[3 * f + k];
  } else if (!mesh.normals.empty()) {
    n = mesh.normals[static_cast<std::size_t>(mesh.faces[f][k])];
  }
  return glm::dot(n, face_normal) < 0 ? -n : n;
}

}  // namespace

LitSurface::LitSurface(const Mesh& mesh) : mesh_(mesh), color_(mesh) {
  attributes_.reserve(3 * kChannels * mesh.faces.size());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    face_normals_.push_back(FaceNormal(mesh, f));
    for (std::size_t k = 0; k < 3; ++k) {
      const auto vertex = static_cast<std::size_t>(mesh.faces[f][k]);
      const glm::vec2 uv = mesh.corner_uvs.empty() ? glm::vec2(0) : mesh.corner_uvs[3 * f + k];
      const glm::vec3 n = CornerNormal(mesh, f, k, UnitOr(face_normals_[f], glm::vec3(0, 1, 0)));
      const glm::vec4 color = mesh.colors.empty() ? glm::vec4(1) : mesh.colors[vertex];
      attributes_.insert(attributes_.end(), {uv.x, uv.y, n.x, n.y, n.z, color.r, color.g, color.b});
    }
  }
}

glm::vec3 LitSurface::Shade(std::size_t face, const Sample& a, glm::vec3 eye) const {
  const glm::vec3 corner = mesh_.positions[static_cast<std::size_t>(mesh_.faces[face][0])];
  const float side = glm::dot(face_normals_[face], eye - corner) < 0 ? -1.0f : 1.0f;
  const glm::vec3 n = side * UnitOr({a[2], a[3], a[4]}, glm::vec3(0, 1, 0));
  const float light = LambertRef<float>({kAmbient, Lights()}, std::array<float, 3>{n.x, n.y, n.z});
  const glm::vec3 color = color_.At(face, {a[0], a[1]}, {a[5], a[6], a[7]});
  return glm::vec3(std::min(1.0f, light * color.r), std::min(1.0f, light * color.g),
                   std::min(1.0f, light * color.b));
}

}  // namespace tilegrad::shade
