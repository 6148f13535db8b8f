// SPDX-License-Identifier: Apache-2.0
#include "train/ops/render_op.h"

#include <algorithm>
#include <array>
#include <memory>

#include "base/error.h"

namespace tilegrad::train {
namespace {

Renderer& RendererOf(SceneRenderer& r, float) { return r.renderer; }
RendererT<double>& RendererOf(SceneRenderer& r, double) { return r.renderer64; }

// The inputs in the order of SceneVars.
enum Slot { kPositions, kColors, kTextures, kLights, kShininess, kSh, kCameras, kSlots };

std::array<nn::Var, kSlots> SlotsOf(const SceneVars& v) {
  return {v.positions, v.colors, v.textures, v.light_directions, v.shininess, v.sh, v.cameras};
}

template <class T>
SurfaceT<T> SurfaceCast(const Surface& s) {
  const auto cast = [](const std::array<float, 3>& v) {
    return std::array<T, 3>{T(v[0]), T(v[1]), T(v[2])};
  };
  return {cast(s.base_color), -1, cast(s.ambient), cast(s.diffuse), cast(s.specular),
          T(s.shininess)};
}

// One rendering of a batch and what its way back needs. Lives in the tape's closure.
template <class T>
class BatchRender {
 public:
  BatchRender(SceneRenderer& renderer, RenderJob job, const std::array<nn::Var, kSlots>& vars)
      : renderer_(RendererOf(renderer, T{})), frame_(FrameOf(renderer, T{})), job_(std::move(job)) {
    for (std::size_t s = 0; s < kSlots; ++s) {
      if (vars[s].valid()) inputs_[s] = vars[s].value();
    }
  }

  Status Check() const;
  Status Forward();
  // d_inputs: of the slots that are there, in their order.
  Status Gradients(std::span<const nn::Tensor> d_outputs, std::span<nn::Tensor> d_inputs);
  const ImagesT<T>& images() const { return frame_.images(); }

 private:
  bool Has(Slot slot) const { return !inputs_[slot].empty(); }
  std::size_t MeshOf(std::size_t image) const {
    return image / static_cast<std::size_t>(job_.views);
  }
  // The numbers of row `row` of a tensor.
  static std::span<T> RowOf(nn::Tensor& tensor, std::size_t row) {
    const std::size_t size = tensor.elements() / static_cast<std::size_t>(tensor.shape()[0]);
    return tensor.span<T>().subspan(row * size, size);
  }
  std::span<const T> Row(Slot slot, std::size_t row) { return RowOf(inputs_[slot], row); }

  SceneT<T> SceneOf(std::size_t image);
  void SetRecords(std::size_t image);

  RendererT<T>& renderer_;
  FrameT<T>& frame_;
  RenderJob job_;
  std::array<nn::Tensor, kSlots> inputs_;
  std::vector<T> uvs_;
  std::vector<TextureT<T>> textures_;  // of images
  std::vector<SurfaceT<T>> surfaces_;
  std::vector<LightT<T>> lights_;
};

template <class T>
Status BatchRender<T>::Check() const {
  const auto images = static_cast<std::int64_t>(job_.cameras.size());
  const std::int64_t meshes = Has(kPositions) ? inputs_[kPositions].shape()[0] : 0;
  if (meshes == 0 || meshes * job_.views != images) {
    return InvalidArgument("{} meshes with {} views each, but {} cameras", meshes, job_.views,
                           images);
  }
  const std::int64_t vertices = inputs_[kPositions].shape()[1];
  const nn::Shape expected[kSlots] = {
      {meshes, vertices, 3}, {meshes, vertices, 3},   {}, {images, 3}, {images},
      {images, 9},           {images, kCameraNumbers}};
  static constexpr const char* kNames[kSlots] = {
      "positions", "colors", "textures", "light_directions", "shininess", "sh", "cameras"};
  for (std::size_t s = 0; s < kSlots; ++s) {
    if (!Has(static_cast<Slot>(s)) || s == kTextures || inputs_[s].shape() == expected[s]) continue;
    return InvalidArgument("{} has the shape {}, expected {}", kNames[s],
                           inputs_[s].shape().ToString(), expected[s].ToString());
  }
  const nn::Shape& t = inputs_[kTextures].shape();
  if (Has(kTextures) && (t.rank() != 4 || t[0] != meshes || t[3] != 3)) {
    return InvalidArgument("textures has the shape {}, expected [{}, h, w, 3]", t.ToString(),
                           meshes);
  }
  return {};
}

// What the renderer takes as records rather than arrays.
template <class T>
void BatchRender<T>::SetRecords(std::size_t image) {
  SurfaceT<T>& surface = surfaces_[image];
  surface = SurfaceCast<T>(job_.surface);
  if (Has(kShininess)) surface.shininess = Row(kShininess, image)[0];
  if (Has(kLights)) std::ranges::copy(Row(kLights, image), lights_[image].direction.begin());
  if (!Has(kTextures)) return;
  const nn::Shape& shape = inputs_[kTextures].shape();
  surface.texture = 0;
  textures_[image] = {Row(kTextures, MeshOf(image)), static_cast<int>(shape[2]),
                      static_cast<int>(shape[1]), job_.wrap, job_.filter};
}

template <class T>
SceneT<T> BatchRender<T>::SceneOf(std::size_t image) {
  SetRecords(image);
  const std::size_t mesh = MeshOf(image);
  SceneT<T> scene;
  scene.positions = Row(kPositions, mesh);
  scene.faces = job_.faces;
  scene.camera = CameraCast<T>(job_.cameras[image]);
  if (Has(kCameras)) {
    const std::span<const T> row = Row(kCameras, image);
    ForEachCameraNumber(scene.camera, row, [](T& to, T from) { to = from; });
  }
  if (Has(kColors)) scene.colors = {Row(kColors, mesh), Rate::kVertex};
  scene.shading = job_.shading;
  scene.surfaces = std::span(surfaces_).subspan(image, 1);
  if (Has(kTextures)) {
    scene.uvs = {uvs_, Rate::kCorner};
    scene.textures = std::span(textures_).subspan(image, 1);
  }
  if (Has(kLights)) scene.lights = std::span(lights_).subspan(image, 1);
  if (Has(kSh)) scene.sh = Row(kSh, image);
  return scene;
}

template <class T>
Status BatchRender<T>::Forward() {
  TILEGRAD_TRY(Check());
  const std::size_t images = job_.cameras.size();
  uvs_.assign(job_.uvs.begin(), job_.uvs.end());
  textures_.resize(images);
  surfaces_.resize(images);
  lights_.resize(images);
  std::vector<SceneT<T>> scenes;
  for (std::size_t n = 0; n < images; ++n) scenes.push_back(SceneOf(n));
  return renderer_.Render(scenes, job_.options, {.attributes = false, .normals = job_.normals},
                          &frame_);
}

// Views of one mesh are given the same arrays, which get their sum in view order.
template <class T>
Status BatchRender<T>::Gradients(std::span<const nn::Tensor> d_outputs,
                                 std::span<nn::Tensor> d_inputs) {
  const std::size_t images = job_.cameras.size();
  std::array<nn::Tensor*, kSlots> d = {};
  for (std::size_t s = 0, next = 0; s < kSlots; ++s) {
    if (Has(static_cast<Slot>(s))) d[s] = &d_inputs[next++];
  }
  std::vector<SceneGradientsT<T>> d_scenes(images);
  std::vector<std::span<T>> d_textures(images);
  std::vector<SurfaceT<T>> d_surfaces(images);
  std::vector<LightT<T>> d_lights(images);
  std::vector<CameraT<T>> d_cameras(images);
  for (std::size_t n = 0; n < images; ++n) {
    SceneGradientsT<T>& out = d_scenes[n];
    out.positions = RowOf(*d[kPositions], MeshOf(n));
    if (Has(kColors)) out.colors = RowOf(*d[kColors], MeshOf(n));
    if (Has(kTextures)) d_textures[n] = RowOf(*d[kTextures], MeshOf(n));
    if (Has(kTextures)) out.textures = std::span(d_textures).subspan(n, 1);
    if (Has(kShininess)) out.surfaces = std::span(d_surfaces).subspan(n, 1);
    if (Has(kLights)) out.lights = std::span(d_lights).subspan(n, 1);
    if (Has(kSh)) out.sh = RowOf(*d[kSh], n);
    if (Has(kCameras)) out.camera = &d_cameras[n];
  }
  FrameGradientsT<T> d_frame;
  if (!d_outputs[0].empty()) d_frame.color = d_outputs[0].template span<T>();
  if (!d_outputs[1].empty()) d_frame.alpha = d_outputs[1].template span<T>();
  TILEGRAD_TRY(renderer_.Backward(frame_, d_frame, d_scenes));
  for (std::size_t n = 0; n < images; ++n) {
    if (Has(kShininess)) RowOf(*d[kShininess], n)[0] = d_surfaces[n].shininess;
    if (Has(kLights)) std::ranges::copy(d_lights[n].direction, RowOf(*d[kLights], n).begin());
    if (!Has(kCameras)) continue;
    const std::span<T> row = RowOf(*d[kCameras], n);
    ForEachCameraNumber(d_cameras[n], row, [](T from, T& to) { to = from; });
  }
  return {};
}

template <class T>
RenderedImages Render(SceneRenderer& renderer, const SceneVars& vars, RenderJob job) {
  nn::Context& context = vars.positions.context();
  const std::array<nn::Var, kSlots> slots = SlotsOf(vars);
  const auto images = static_cast<std::int64_t>(job.cameras.size());
  const std::int64_t height = job.options.height, width = job.options.width;
  auto batch = std::make_shared<BatchRender<T>>(renderer, std::move(job), slots);
  if (Status status = batch->Forward(); !status.ok()) {
    const nn::Var failed = nn::Fail(vars.positions, std::move(status));
    return {failed, failed};
  }
  std::vector<nn::Var> inputs;
  std::vector<nn::Shape> shapes;
  for (const nn::Var& var : slots) {
    if (var.valid()) {
      inputs.push_back(var);
      shapes.push_back(var.shape());
    }
  }
  auto backward = [batch, &context, shapes](std::span<const nn::Tensor> d_outputs) {
    std::vector<nn::Tensor> d_inputs;
    d_inputs.reserve(shapes.size());
    for (const nn::Shape& shape : shapes) {
      d_inputs.push_back(context.Empty(shape, nn::kDTypeOf<T>));
    }
    if (Status status = batch->Gradients(d_outputs, d_inputs); !status.ok())
      context.Fail(std::move(status));
    return d_inputs;
  };
  const ImagesT<T>& drawn = batch->images();
  const std::vector<nn::Var> out =
      nn::External(context, {.name = "render",
                             .inputs = inputs,
                             .outputs = {context.From({images, 3, height, width}, drawn.color),
                                         context.From({images, height, width}, drawn.alpha)},
                             .backward = std::move(backward)});
  return {out[0], out[1]};
}

}  // namespace

RenderedImages RenderScenes(SceneRenderer& renderer, const SceneVars& scenes, RenderJob job) {
  if (!scenes.positions.valid()) return {scenes.positions, scenes.positions};
  return nn::WithFloatType(scenes.positions.dtype(),
                           [&]<class T>(T) { return Render<T>(renderer, scenes, std::move(job)); });
}

}  // namespace tilegrad::train
