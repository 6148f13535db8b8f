// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/textured_image/object_pictures.h"

#include <algorithm>

#include "base/error.h"
#include "render/picture/composite.h"
#include "render/picture/mesh_scene.h"
#include "render/renderer.h"
#include "scene/camera_conventions.h"
#include "scene/light_frame.h"
#include "train/data/stream/average_samples.h"

namespace tilegrad::train {
namespace {

MeshSceneOptions SceneOptions(const Surface& surface) {
  MeshSceneOptions options;
  options.color_space = ColorSpace::kSrgb;
  options.normals = NormalSource::kSmooth;
  options.filter = Filter::kBilinear;
  options.ambient = surface.ambient;
  options.diffuse = surface.diffuse;
  options.specular = surface.specular;
  options.shininess = surface.shininess;
  options.blend = false;
  return options;
}

}  // namespace

ObjectPictures::ObjectPictures(const LightConfig& light, int size, int samples)
    : light_(light),
      size_(size),
      samples_(samples),
      alone_(std::make_unique<Workers>(1)),
      renderer_(RendererOn(*alone_)) {}

Result<std::vector<float>> ObjectPictures::Draw(const Mesh& mesh, const TexturedView& view,
                                                Appearance appearance) {
  Surface surface = SurfaceUnder(light_);
  surface.shininess = view.light.shininess;
  const MeshScene made(mesh, SceneOptions(surface));
  Scene scene = made.scene();
  scene.camera = ScaledCamera(view.camera, static_cast<float>(samples_));
  const Lighting lighting = IsLit(appearance) ? LightingOf(light_) : Lighting::kNone;
  scene.shading = {.lighting = lighting, .two_sided = true, .clamp = true};
  Light light;
  light.direction = DirectionToWorld(view.light.direction, view.camera);
  const std::array<float, 9> sh = HarmonicsToWorld(view.light.sh, view.camera);
  if (lighting == Lighting::kLambert || lighting == Lighting::kPhong) scene.lights = {&light, 1};
  if (lighting == Lighting::kSphericalHarmonics) scene.sh = sh;
  if (appearance == Appearance::kLight) {
    scene.textures = {};
    scene.uvs = {};
    scene.colors = {};
    scene.surfaces = {&surface, 1};
    scene.face_surfaces = {};
  }
  const RenderOptions options{.width = samples_ * size_, .height = samples_ * size_};
  TILEGRAD_TRY(renderer_.Render({&scene, 1}, options, OutputsOf(appearance), &frame_));
  std::vector<float> out(4 * static_cast<std::size_t>(size_) * static_cast<std::size_t>(size_));
  AverageSamples(frame_.images(), 0, samples_, out);
  return out;
}

ImageU8 OnPaper(std::span<const float> rgba, int size) {
  const std::size_t rgb = rgba.size() / 4 * 3;
  return OverGrey(PlanarRgba<float>{rgba.first(rgb), rgba.subspan(rgb), size, size}, kPaper);
}

std::vector<std::uint8_t> ToBytes(std::span<const float> rgba) {
  std::vector<std::uint8_t> out(rgba.size());
  std::ranges::transform(rgba, out.begin(), ToByte);
  return out;
}

}  // namespace tilegrad::train
