// SPDX-License-Identifier: Apache-2.0
#include "render/picture/mesh_pictures.h"

#include <glm/geometric.hpp>

#include "base/error.h"
#include "render/picture/composite.h"
#include "render/picture/mesh_scene.h"
#include "render/picture/picture.h"
#include "scene/camera_conventions.h"

namespace tilegrad {
namespace {

constexpr int kMaxSize = 4096;
constexpr int kLitSamples = 4, kUnlitSamples = 3;  // per side of a pixel

MeshSceneOptions LitOptions() {
  MeshSceneOptions options;
  options.color_space = ColorSpace::kSrgb;
  options.normals = NormalSource::kAligned;
  options.ambient.fill(kDatasetAmbient);
  options.blend = false;
  return options;
}

constexpr float kKey = 0.45f, kFill = 0.2f;

Light LightFrom(glm::vec3 towards, float intensity) {
  const glm::vec3 d = glm::normalize(towards);
  return {{d.x, d.y, d.z}, intensity};
}

}  // namespace

std::array<Light, 2> DatasetLights() {
  return {LightFrom({0.35f, 0.8f, 0.5f}, kKey), LightFrom({-0.6f, 0.3f, -0.75f}, kFill)};
}

Surface DatasetSurface() {
  Surface surface;
  surface.ambient.fill(kDatasetAmbient);
  surface.specular.fill(0);
  return surface;
}

struct LitRenderer::Impl {
  Workers workers{1};
  PictureRenderer renderer{workers};
  Picture picture;

  template <class Visit>
  Status Draw(const Mesh& mesh, std::span<const Camera> cameras, int size, const Visit& visit) {
    if (size < 1 || size > kMaxSize) {
      return InvalidArgument("the size must be in [1, {}] pixels, got {}", kMaxSize, size);
    }
    TILEGRAD_TRY(Validate(mesh));
    if (mesh.faces.empty()) return InvalidArgument("the mesh has no faces");
    const std::array<Light, 2> lights = DatasetLights();
    const MeshScene made(mesh, LitOptions());
    Scene scene = made.scene();
    scene.shading.lighting = Lighting::kLambert;
    scene.lights = lights;
    for (const Camera& camera : cameras) {
      scene.camera = camera;
      const PictureRequest request{
          .width = size, .height = size, .supersampling = kLitSamples, .cover = made.cover()};
      TILEGRAD_TRY(renderer.Render(scene, request, &picture));
      visit(picture);
    }
    return {};
  }
};

LitRenderer::LitRenderer() : impl_(std::make_unique<Impl>()) {}
LitRenderer::~LitRenderer() = default;
LitRenderer::LitRenderer(LitRenderer&&) noexcept = default;

Result<std::vector<std::uint8_t>> LitRenderer::Render(const Mesh& mesh,
                                                      std::span<const Camera> cameras, int size) {
  std::vector<std::uint8_t> out;
  TILEGRAD_TRY(impl_->Draw(mesh, cameras, size, [&](const Picture& picture) {
    const auto planes = PremultipliedPlanes(picture);
    out.insert(out.end(), planes.begin(), planes.end());
  }));
  return out;
}

Result<ImageU8> LitRenderer::RenderStraight(const Mesh& mesh, const Camera& camera, int size) {
  ImageU8 out;
  TILEGRAD_TRY(impl_->Draw(mesh, {&camera, 1}, size,
                           [&](const Picture& picture) { out = StraightRgba(picture); }));
  return out;
}

Result<std::vector<ImageU8>> DrawMesh(const Mesh& mesh, const UnlitPictures& request,
                                      const Workers& workers) {
  TILEGRAD_TRY(Validate(mesh));
  const MeshScene made(mesh, {.color_space = ColorSpace::kSrgb});
  Scene scene = made.scene();
  PictureRenderer renderer(workers);
  Picture picture;
  std::vector<ImageU8> out;
  for (const Camera& camera : request.cameras) {
    scene.camera = ScaledCamera(
        camera, static_cast<float>(request.size) / static_cast<float>(request.camera_size));
    TILEGRAD_TRY(renderer.Render(
        scene, {.width = request.size, .height = request.size, .supersampling = kUnlitSamples},
        &picture));
    out.push_back(OverGrey(picture, kPaper));
  }
  return out;
}

}  // namespace tilegrad
