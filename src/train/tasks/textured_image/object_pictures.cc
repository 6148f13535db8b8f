// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/textured_image/object_pictures.h"

#include <algorithm>

#include "render/picture/composite.h"
#include "render/picture/mesh_scene.h"
#include "render/renderer.h"
#include "scene/camera_conventions.h"
#include "scene/light_frame.h"
#include "scene/shrink_image.h"
#include "train/data/stream/textured_stream.h"

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

class PictureRow {
 public:
  PictureRow(const ShownObject& shown, ObjectPictures& pictures, int size)
      : shown_(shown), pictures_(pictures), size_(size) {}

  Result<std::vector<ShownPicture>> Make() {
    const auto& [name, object, truth] = shown_;
    TexturedView view = truth.views[0];
    view.light = object.light;
    AddTruth("input", truth.lit, 0);
    TILEGRAD_TRY(AddPrediction("texture + light", view, Appearance::kLit));
    TILEGRAD_TRY(AddPrediction("texture", view, Appearance::kTexture));
    TILEGRAD_TRY(AddPrediction("light", view, Appearance::kLight));
    AddTruth("true texture", truth.texture, 0);
    AddTruth("true light", truth.light, 0);
    for (std::size_t v = 1; v < truth.views.size(); ++v) {
      TILEGRAD_TRY(AddPrediction("another view", truth.views[v], Appearance::kTexture));
      AddTruth("truth", truth.texture, v);
    }
    Add("map", object.mesh.textures[0].image);
    return std::move(out_);
  }

 private:
  void Add(const std::string& caption, ImageU8 image) {
    out_.push_back({std::move(image), caption, shown_.name + ": " + caption});
  }
  void AddTruth(const std::string& caption, const std::vector<float>& pictures, std::size_t view) {
    Add(caption, OnPaper(shown_.truth.Of(pictures, view), size_));
  }
  Status AddPrediction(const std::string& caption, const TexturedView& view,
                       Appearance appearance) {
    TILEGRAD_ASSIGN(const auto rgba, pictures_.Draw(shown_.object.mesh, view, appearance));
    Add(caption, OnPaper(rgba, size_));
    return {};
  }

  const ShownObject& shown_;
  ObjectPictures& pictures_;
  int size_;
  std::vector<ShownPicture> out_;
};

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
  scene.shading.lighting = lighting;
  scene.shading.clamp = true;
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

std::vector<std::uint8_t> ToBytes(std::span<const float> rgba) {
  std::vector<std::uint8_t> out(rgba.size());
  std::ranges::transform(rgba, out.begin(), ToByte);
  return out;
}

Result<std::vector<ShownPicture>> PicturesOf(const ShownObject& shown, ObjectPictures& pictures,
                                             int size) {
  return PictureRow(shown, pictures, size).Make();
}

ImageU8 SheetOf(const std::vector<std::vector<ShownPicture>>& rows, int size) {
  constexpr int kZoom = 2, kGap = 2;
  std::vector<ImageU8> cells;
  for (const auto& row : rows) {
    for (const ShownPicture& picture : row)
      cells.push_back(Enlarged(ShrunkImage(picture.image, size), kZoom));
  }
  return TileImages(cells, static_cast<int>(rows[0].size()), kGap);
}

}  // namespace tilegrad::train
