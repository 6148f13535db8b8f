// SPDX-License-Identifier: Apache-2.0
#include "render/picture/lit_renderer.h"

#include <algorithm>

#include "base/error.h"
#include "render/renderer.h"
#include "shade/lit_surface.h"

namespace tilegrad {
namespace {

using shade::LitSurface;

constexpr int kMaxSize = 4096;

glm::vec3 EyeOf(const Camera& camera) {  // -R^T t
  glm::vec3 eye(0);
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) eye[c] -= camera.rotation[3 * r + c] * camera.translation[r];
  }
  return eye;
}

Camera Enlarge(Camera camera, float factor) {
  camera.fx *= factor, camera.fy *= factor;
  camera.cx *= factor, camera.cy *= factor;
  return camera;
}

Scene ViewOf(const Mesh& mesh, const LitSurface& surface, const Camera& camera) {
  Scene view;
  view.positions = {&mesh.positions[0].x, 3 * mesh.positions.size()};
  view.faces = {mesh.faces[0].data(), 3 * mesh.faces.size()};
  view.attributes = {surface.attributes(), Rate::kCorner};
  view.channels = LitSurface::kChannels;
  view.camera = camera;
  return view;
}

std::uint8_t ToByte(float value) {
  return static_cast<std::uint8_t>(std::clamp(value, 0.0f, 1.0f) * 255 + 0.5f);
}

}  // namespace

struct LitRenderer::Impl {
  Workers workers{1};
  Renderer renderer = RendererOn(workers);
  Frame frame;
  std::vector<float> sums;  // [4][size][size]

  LitSurface::Sample SampleAt(std::size_t sample) const {
    const Images& images = frame.images();
    LitSurface::Sample out;
    for (std::size_t c = 0; c < out.size(); ++c) {
      out[c] = images.attributes[c * images.face_ids.size() + sample];
    }
    return out;
  }

  // Shades the frame's samples and averages them to `image`.
  void Resolve(const LitSurface& surface, glm::vec3 eye, std::size_t size, std::uint8_t* image) {
    const std::size_t pixels = size * size, width = size * kSupersampling;
    const std::span<const std::int32_t> face_ids = frame.images().face_ids;
    sums.assign(4 * pixels, 0.0f);
    for (std::size_t s = 0; s < face_ids.size(); ++s) {
      if (face_ids[s] < 0) continue;
      const std::size_t pixel = s / width / kSupersampling * size + s % width / kSupersampling;
      const glm::vec3 color =
          surface.Shade(static_cast<std::size_t>(face_ids[s]), SampleAt(s), eye);
      for (int c = 0; c < 3; ++c) sums[static_cast<std::size_t>(c) * pixels + pixel] += color[c];
      sums[3 * pixels + pixel] += 1;
    }
    constexpr float kShare = 1.0f / (kSupersampling * kSupersampling);
    std::transform(sums.begin(), sums.end(), image, [](float v) { return ToByte(v * kShare); });
  }
};

LitRenderer::LitRenderer() : impl_(std::make_unique<Impl>()) {}
LitRenderer::~LitRenderer() = default;
LitRenderer::LitRenderer(LitRenderer&&) noexcept = default;

Result<std::vector<std::uint8_t>> LitRenderer::Render(const Mesh& mesh,
                                                      std::span<const Camera> cameras, int size) {
  if (size < 1 || size > kMaxSize) {
    return InvalidArgument("the size must be in [1, {}] pixels, got {}", kMaxSize, size);
  }
  TILEGRAD_TRY(Validate(mesh));
  if (mesh.faces.empty()) return InvalidArgument("the mesh has no faces");
  const LitSurface surface(mesh);
  RenderOptions options;
  options.width = options.height = size * kSupersampling;
  const Outputs request{.color = false, .alpha = false};
  const auto side = static_cast<std::size_t>(size);
  std::vector<std::uint8_t> out(cameras.size() * 4 * side * side);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const Scene view = ViewOf(mesh, surface, Enlarge(cameras[i], kSupersampling));
    TILEGRAD_TRY(impl_->renderer.Render({&view, 1}, options, request, &impl_->frame));
    impl_->Resolve(surface, EyeOf(cameras[i]), side, out.data() + i * 4 * side * side);
  }
  return out;
}

std::vector<glm::vec3> CornerColors(const Mesh& mesh) {
  const shade::SurfaceColor surface(mesh);
  std::vector<glm::vec3> out;
  out.reserve(3 * mesh.faces.size());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (int k = 0; k < 3; ++k) out.push_back(surface.AtCorner(f, k));
  }
  return out;
}

}  // namespace tilegrad
