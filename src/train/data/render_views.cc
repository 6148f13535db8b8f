// SPDX-License-Identifier: Apache-2.0
#include "train/data/render_views.h"

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>

#include "render/renderer.h"
#include "shade/lambert_ref.h"
#include "train/data/surface_color.h"

namespace tilegrad::train {
namespace {

constexpr int kChannels = 8;  // uv, normal, vertex colour
constexpr float kAmbient = 0.45f, kKey = 0.45f, kFill = 0.2f;

using Light = shade::DirectionalLightT<float>;

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

// The normal of corner k of face f, on the side of the face's winding: authors' normals point to
// either side.
glm::vec3 CornerNormal(const Mesh& mesh, std::size_t f, std::size_t k, glm::vec3 face_normal) {
  glm::vec3 n = face_normal;
  if (!mesh.corner_normals.empty()) {
    n = mesh.corner_normals[3 * f + k];
  } else if (!mesh.normals.empty()) {
    n = mesh.normals[static_cast<std::size_t>(mesh.faces[f][k])];
  }
  return glm::dot(n, face_normal) < 0 ? -n : n;
}

glm::vec3 EyeOf(const Camera& camera) {  // -R^T t
  glm::vec3 eye(0);
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) eye[c] -= camera.rotation[3 * r + c] * camera.translation[r];
  }
  return eye;
}

std::uint8_t ToByte(float value) {
  return static_cast<std::uint8_t>(std::clamp(value, 0.0f, 1.0f) * 255 + 0.5f);
}

}  // namespace

struct ViewRenderer::Impl {
  Workers workers{1};
  Renderer renderer{workers};
  Frame frame;
  std::vector<float> attributes;        // [F,3,kChannels]
  std::vector<glm::vec3> face_normals;  // not normalised
  std::vector<float> sums;              // [4][size][size]

  void Prepare(const Mesh& mesh);
  SceneView View(const Mesh& mesh, const Camera& camera) const;
  glm::vec3 ShadeSample(const Mesh& mesh, const SurfaceColor& surface, glm::vec3 eye,
                        std::size_t sample) const;
  void Resolve(const Mesh& mesh, const SurfaceColor& surface, const Camera& camera, int size,
               std::uint8_t* image);
};

void ViewRenderer::Impl::Prepare(const Mesh& mesh) {
  attributes.clear();
  face_normals.resize(mesh.faces.size());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    face_normals[f] = FaceNormal(mesh, f);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto vertex = static_cast<std::size_t>(mesh.faces[f][k]);
      const glm::vec2 uv = mesh.corner_uvs.empty() ? glm::vec2(0) : mesh.corner_uvs[3 * f + k];
      const glm::vec3 n = CornerNormal(mesh, f, k, UnitOr(face_normals[f], glm::vec3(0, 1, 0)));
      const glm::vec4 color = mesh.colors.empty() ? glm::vec4(1) : mesh.colors[vertex];
      attributes.insert(attributes.end(), {uv.x, uv.y, n.x, n.y, n.z, color.r, color.g, color.b});
    }
  }
}

SceneView ViewRenderer::Impl::View(const Mesh& mesh, const Camera& camera) const {
  SceneView view;
  view.positions = {&mesh.positions[0].x, 3 * mesh.positions.size()};
  view.faces = {mesh.faces[0].data(), 3 * mesh.faces.size()};
  view.attributes = attributes;
  view.channels = kChannels;
  view.rate = AttributeRate::kCorner;
  view.camera = camera;
  return view;
}

glm::vec3 ViewRenderer::Impl::ShadeSample(const Mesh& mesh, const SurfaceColor& surface,
                                          glm::vec3 eye, std::size_t sample) const {
  const std::size_t plane = frame.face_ids.size();
  std::array<float, kChannels> a;
  for (std::size_t c = 0; c < kChannels; ++c) a[c] = frame.attributes[c * plane + sample];
  const auto face = static_cast<std::size_t>(frame.face_ids[sample]);
  const glm::vec3 corner = mesh.positions[static_cast<std::size_t>(mesh.faces[face][0])];
  const float side = glm::dot(face_normals[face], eye - corner) < 0 ? -1.0f : 1.0f;
  const glm::vec3 n = side * UnitOr({a[2], a[3], a[4]}, glm::vec3(0, 1, 0));
  const float light =
      shade::LambertRef<float>({kAmbient, Lights()}, std::array<float, 3>{n.x, n.y, n.z});
  const glm::vec3 color = surface.At(face, {a[0], a[1]}, {a[5], a[6], a[7]});
  return glm::vec3(std::min(1.0f, light * color.r), std::min(1.0f, light * color.g),
                   std::min(1.0f, light * color.b));
}

void ViewRenderer::Impl::Resolve(const Mesh& mesh, const SurfaceColor& surface,
                                 const Camera& camera, int size, std::uint8_t* image) {
  const glm::vec3 eye = EyeOf(camera);
  const auto pixels = static_cast<std::size_t>(size) * size;
  sums.assign(4 * pixels, 0.0f);
  for (std::size_t s = 0; s < frame.face_ids.size(); ++s) {
    if (frame.face_ids[s] < 0) continue;
    const std::size_t width = static_cast<std::size_t>(size) * kSupersampling;
    const std::size_t pixel =
        s / width / kSupersampling * static_cast<std::size_t>(size) + s % width / kSupersampling;
    const glm::vec3 color = ShadeSample(mesh, surface, eye, s);
    for (int c = 0; c < 3; ++c) sums[static_cast<std::size_t>(c) * pixels + pixel] += color[c];
    sums[3 * pixels + pixel] += 1;
  }
  constexpr float kShare = 1.0f / (kSupersampling * kSupersampling);
  std::transform(sums.begin(), sums.end(), image, [](float v) { return ToByte(v * kShare); });
}

ViewRenderer::ViewRenderer() : impl_(std::make_unique<Impl>()) {}
ViewRenderer::~ViewRenderer() = default;
ViewRenderer::ViewRenderer(ViewRenderer&&) noexcept = default;

Result<std::vector<std::uint8_t>> ViewRenderer::Render(const Mesh& mesh, const CameraRule& rule,
                                                       int views) {
  const SurfaceColor surface(mesh);
  impl_->Prepare(mesh);
  CameraRule large = rule;
  large.lens.width *= kSupersampling, large.lens.height *= kSupersampling;
  RenderOptions options;
  options.width = large.lens.width, options.height = large.lens.height;
  const RenderRequest request{.attributes = true, .alpha = false};
  const std::size_t image = 4 * static_cast<std::size_t>(rule.lens.width) * rule.lens.width;
  std::vector<std::uint8_t> out(image * static_cast<std::size_t>(views));
  for (int i = 0; i < views; ++i) {
    const SceneView view = impl_->View(mesh, large.View(i));
    TILEGRAD_TRY(impl_->renderer.Render({&view, 1}, options, request, &impl_->frame));
    impl_->Resolve(mesh, surface, view.camera, rule.lens.width,
                   out.data() + image * static_cast<std::size_t>(i));
  }
  return out;
}

}  // namespace tilegrad::train
