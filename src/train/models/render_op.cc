// SPDX-License-Identifier: Apache-2.0
#include "train/models/render_op.h"

#include <algorithm>
#include <array>
#include <memory>

#include "base/error.h"

namespace tilegrad::train {
namespace {

Renderer& RendererOf(SceneRenderer& r, float) { return r.renderer; }
RendererT<double>& RendererOf(SceneRenderer& r, double) { return r.renderer64; }

// The inputs in the order of SceneVars.
enum Slot {
  kPositions,
  kColors,
  kTextures,
  kLights,
  kShininess,
  kSh,
  kCameras,
  kUvs,
  kReflectance,
  kSlots
};
constexpr const char* kSlotNames[kSlots] = {"positions",        "colors",    "textures",
                                            "light_directions", "shininess", "sh",
                                            "cameras",          "uvs",       "reflectance"};

std::array<nn::Var, kSlots> SlotsOf(const SceneVars& v) {
  return {v.positions, v.colors,  v.textures, v.light_directions, v.shininess,
          v.sh,        v.cameras, v.uvs,      v.reflectance};
}

// The inputs of one image that the renderer takes as records, not arrays; or their gradients.
template <class T>
struct ImageRecords {
  TextureT<T> texture;
  std::span<T> d_texture;
  SurfaceT<T> surface;
  LightT<T> light;
  CameraT<T> camera;
};

// Calls visit(slot, where numbers begin in an image's row of it, numbers).
template <class T, class Visit>
void ForEachRow(ImageRecords<T>& r, const Visit& visit) {
  visit(kLights, 0, std::span(r.light.direction));
  visit(kShininess, 0, std::span(&r.surface.shininess, 1));
  visit(kReflectance, 0, std::span(r.surface.ambient));
  visit(kReflectance, 3, std::span(r.surface.diffuse));
  visit(kReflectance, 6, std::span(r.surface.specular));
  std::size_t at = 0;
  ForEachCameraNumber(r.camera, [&](T& number) { visit(kCameras, at++, std::span(&number, 1)); });
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
      wanted_[s] = vars[s].requires_grad();
    }
  }

  Status Check() const {
    const auto images = static_cast<std::int64_t>(job_.cameras.size());
    const std::int64_t meshes = Has(kPositions) ? inputs_[kPositions].shape()[0] : 0;
    if (meshes == 0 || meshes * job_.views != images)
      return InvalidArgument("{} meshes with {} views each, but {} cameras", meshes, job_.views,
                             images);
    const std::int64_t vertices = inputs_[kPositions].shape()[1];
    const nn::Shape expected[kSlots] = {{meshes, vertices, 3},
                                        {meshes, vertices, 3},
                                        {},
                                        {images, 3},
                                        {images},
                                        {images, 9},
                                        {images, kCameraNumbers},
                                        {static_cast<std::int64_t>(job_.faces.size()) / 3, 3, 2},
                                        {images, 9}};
    for (std::size_t s = 0; s < kSlots; ++s) {
      if (!Has(static_cast<Slot>(s)) || s == kTextures || inputs_[s].shape() == expected[s])
        continue;
      return InvalidArgument("{} has the shape {}, expected {}", kSlotNames[s],
                             inputs_[s].shape().ToString(), expected[s].ToString());
    }
    const nn::Shape& t = inputs_[kTextures].shape();
    if (Has(kTextures) && (t.rank() != 4 || t[0] != meshes || t[3] != 3))
      return InvalidArgument("textures has the shape {}, expected [{}, h, w, 3]", t.ToString(),
                             meshes);
    return {};
  }

  Status Forward() {
    TILEGRAD_TRY(Check());
    const std::size_t images = job_.cameras.size();
    uvs_.assign(job_.uvs.begin(), job_.uvs.end());
    records_.resize(images);
    std::vector<SceneT<T>> scenes;
    for (std::size_t n = 0; n < images; ++n) scenes.push_back(SceneOf(n));
    return renderer_.Render(scenes, job_.options,
                            {.alpha = job_.alpha, .attributes = false, .normals = job_.normals},
                            &frame_);
  }

  // For the slots present, in their order; empty for those that need none.
  Result<std::vector<nn::Tensor>> Gradients(nn::Context& context,
                                            std::span<const nn::Tensor> d_outputs) {
    const std::size_t images = job_.cameras.size();
    Tensors d;
    for (std::size_t s = 0; s < kSlots; ++s) {
      if (wanted_[s]) d[s] = context.Empty(inputs_[s].shape(), nn::kDTypeOf<T>);
    }
    std::vector<ImageRecords<T>> records(images);
    std::vector<SceneGradientsT<T>> d_scenes;
    d_scenes.reserve(images);
    for (std::size_t n = 0; n < images; ++n) d_scenes.push_back(GradientsOf(n, d, records[n]));
    FrameGradientsT<T> d_frame;
    if (!d_outputs[0].empty()) d_frame.color = d_outputs[0].template span<T>();
    if (job_.alpha && !d_outputs[1].empty()) d_frame.alpha = d_outputs[1].template span<T>();
    TILEGRAD_TRY(renderer_.Backward(frame_, d_frame, d_scenes));
    for (std::size_t n = 0; n < images; ++n) {
      ForEachRow(records[n], [&](Slot slot, std::size_t at, auto numbers) {
        if (wanted_[slot]) std::ranges::copy(numbers, RowOf(d[slot], n).subspan(at).begin());
      });
    }
    std::vector<nn::Tensor> out;
    for (std::size_t s = 0; s < kSlots; ++s) {
      if (Has(static_cast<Slot>(s))) out.push_back(d[s]);
    }
    return out;
  }

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

  using Tensors = std::array<nn::Tensor, kSlots>;

  void SetRecords(std::size_t image) {
    ImageRecords<T>& r = records_[image];
    r.surface = SurfaceCast<T>(job_.surface);
    r.camera = CameraCast<T>(job_.cameras[image]);
    ForEachRow(r, [&](Slot slot, std::size_t at, auto numbers) {
      if (Has(slot))
        std::ranges::copy(Row(slot, image).subspan(at, numbers.size()), numbers.begin());
    });
    if (!Has(kTextures)) return;
    const nn::Shape& shape = inputs_[kTextures].shape();
    r.surface.texture = 0;
    r.texture = {Row(kTextures, MeshOf(image)), static_cast<int>(shape[2]),
                 static_cast<int>(shape[1]), job_.wrap, job_.filter};
  }

  SceneT<T> SceneOf(std::size_t image) {
    SetRecords(image);
    const ImageRecords<T>& r = records_[image];
    const std::size_t mesh = MeshOf(image);
    SceneT<T> scene;
    scene.positions = Row(kPositions, mesh);
    scene.faces = job_.faces;
    scene.camera = r.camera;
    if (Has(kColors)) scene.colors = {Row(kColors, mesh), Rate::kVertex};
    scene.shading = job_.shading;
    scene.surfaces = {&r.surface, 1};
    if (Has(kTextures)) {
      scene.uvs = {Has(kUvs) ? inputs_[kUvs].span<T>() : std::span<const T>(uvs_), Rate::kCorner};
      scene.textures = {&r.texture, 1};
    }
    if (Has(kLights)) scene.lights = {&r.light, 1};
    if (Has(kSh)) scene.sh = Row(kSh, image);
    return scene;
  }

  // Views of one mesh are given the same arrays, which get their sum in view order.
  SceneGradientsT<T> GradientsOf(std::size_t image, Tensors& d, ImageRecords<T>& records) const {
    SceneGradientsT<T> out;
    const std::size_t mesh = MeshOf(image);
    if (wanted_[kPositions]) out.positions = RowOf(d[kPositions], mesh);
    if (wanted_[kColors]) out.colors = RowOf(d[kColors], mesh);
    if (wanted_[kUvs]) out.uvs = d[kUvs].template span<T>();
    if (wanted_[kTextures]) records.d_texture = RowOf(d[kTextures], mesh);
    if (wanted_[kTextures]) out.textures = {&records.d_texture, 1};
    if (wanted_[kShininess] || wanted_[kReflectance]) out.surfaces = {&records.surface, 1};
    if (wanted_[kLights]) out.lights = {&records.light, 1};
    if (wanted_[kSh]) out.sh = RowOf(d[kSh], image);
    if (wanted_[kCameras]) out.camera = &records.camera;
    return out;
  }

  RendererT<T>& renderer_;
  FrameT<T>& frame_;
  RenderJob job_;
  std::array<nn::Tensor, kSlots> inputs_;
  std::array<bool, kSlots> wanted_ = {};
  std::vector<T> uvs_;                    // of the job
  std::vector<ImageRecords<T>> records_;  // of images
};

template <class T>
RenderedImages Render(SceneRenderer& renderer, const SceneVars& vars, RenderJob job) {
  nn::Context& context = vars.positions.context();
  const std::array<nn::Var, kSlots> slots = SlotsOf(vars);
  const auto images = static_cast<std::int64_t>(job.cameras.size());
  const std::int64_t height = job.options.height, width = job.options.width;
  const bool alpha = job.alpha;
  auto batch = std::make_shared<BatchRender<T>>(renderer, std::move(job), slots);
  if (Status status = batch->Forward(); !status.ok()) {
    const nn::Var failed = nn::Fail(vars.positions, std::move(status));
    return {failed, failed};
  }
  nn::ExternalOp op{.name = "render"};
  for (const nn::Var& var : slots) {
    if (var.valid()) op.inputs.push_back(var);
  }
  const ImagesT<T>& drawn = batch->images();
  op.outputs = {context.From({images, 3, height, width}, drawn.color)};
  if (alpha) op.outputs.push_back(context.From({images, height, width}, drawn.alpha));
  op.backward = [batch, &context](std::span<const nn::Tensor> d_outputs) {
    auto gradients = batch->Gradients(context, d_outputs);
    if (gradients.ok()) return std::move(*gradients);
    context.Fail(gradients.status());
    return std::vector<nn::Tensor>();
  };
  const std::vector<nn::Var> out = nn::External(context, std::move(op));
  return {out[0], alpha ? out[1] : nn::Var()};
}

rivals::RendererT<float>& RendererOf(RivalRenderer& r, float) { return r.renderer; }
rivals::RendererT<double>& RendererOf(RivalRenderer& r, double) { return r.renderer64; }

struct RivalColors {
  const nn::Var& colors;  // invalid: none
  bool faces = false;     // texels of faces, else colours of vertices
};

// The numbers of the i-th tensor, if present.
template <class T>
std::span<T> SpanOf(std::span<const nn::Tensor> tensors, std::size_t i) {
  if (i >= tensors.size() || tensors[i].empty()) return {};
  nn::Tensor tensor = tensors[i];  // shares its memory
  return tensor.span<T>();
}

// One rendering and what its way back needs. Lives in the tape's closure.
template <class T>
struct RivalBatch {
  rivals::RendererT<T>& renderer;
  RivalJob job;
  nn::Tensor positions, colors;  // colors: empty without
  bool textured;                 // they are texels of faces
  std::vector<CameraT<T>> cameras;

  RivalBatch(RivalRenderer& r, RivalJob rival_job, const nn::Var& at, const RivalColors& of)
      : renderer(RendererOf(r, T{})),
        job(std::move(rival_job)),
        positions(at.value()),
        textured(of.faces) {
    if (of.colors.valid()) colors = of.colors.value();
    for (const Camera& camera : job.cameras) cameras.push_back(CameraCast<T>(camera));
  }
  rivals::BatchT<T> View() {
    const std::span<const T> given = colors.empty() ? std::span<T>() : colors.span<T>();
    rivals::BatchT<T> batch{positions.span<T>(),
                            {},
                            job.faces,
                            cameras,
                            static_cast<std::size_t>(positions.shape()[0]),
                            job.size};
    (textured ? batch.textures : batch.colors) = given;
    return batch;
  }
  std::vector<nn::Tensor> Images(nn::Context& context) const {
    const auto n = static_cast<std::int64_t>(cameras.size());
    std::vector<nn::Tensor> out = {context.Empty({n, job.size, job.size}, nn::kDTypeOf<T>)};
    if (!colors.empty()) out.push_back(context.Empty({n, 3, job.size, job.size}, nn::kDTypeOf<T>));
    return out;
  }

  std::vector<nn::Tensor> Gradients(nn::Context& context, std::span<const nn::Tensor> d_outputs) {
    std::vector<nn::Tensor> out = {context.Empty(positions.shape(), nn::kDTypeOf<T>)};
    if (!colors.empty()) out.push_back(context.Empty(colors.shape(), nn::kDTypeOf<T>));
    rivals::GradientsT<T> to{SpanOf<T>(out, 0), {}};
    (textured ? to.textures : to.colors) = SpanOf<T>(out, 1);
    Status done = renderer.Backward(View(), job.options,
                                    {SpanOf<T>(d_outputs, 0), SpanOf<T>(d_outputs, 1)}, to);
    if (!done.ok()) context.Fail(std::move(done));
    return out;
  }
};

template <class T>
RenderedImages Render(RivalRenderer& renderer, const nn::Var& positions, const RivalColors& colors,
                      RivalJob job) {
  nn::Context& context = positions.context();
  auto batch = std::make_shared<RivalBatch<T>>(renderer, std::move(job), positions, colors);
  const std::vector<nn::Tensor> images = batch->Images(context);
  Status status = batch->renderer.Render(batch->View(), batch->job.options,
                                         {SpanOf<T>(images, 0), SpanOf<T>(images, 1)});
  if (!status.ok()) {
    const nn::Var failed = nn::Fail(positions, std::move(status));
    return {failed, failed};
  }
  std::vector<nn::Var> inputs = {positions};
  if (colors.colors.valid()) inputs.push_back(colors.colors);
  const std::vector<nn::Var> out =
      nn::External(context, {.name = "render_rival",
                             .inputs = inputs,
                             .outputs = images,
                             .backward = [batch, &context](std::span<const nn::Tensor> d_outputs) {
                               return batch->Gradients(context, d_outputs);
                             }});
  return {out.size() > 1 ? out[1] : nn::Var(), out[0]};
}

RenderedImages RenderChecked(RivalRenderer& renderer, const nn::Var& positions,
                             const RivalColors& colors, RivalJob job) {
  if (!positions.valid()) return {positions, positions};
  const nn::Shape& shape = positions.shape();
  if (shape.rank() != 3 || shape[2] != 3 || job.size < 1) {
    const nn::Var failed = nn::Fail(
        positions, InvalidArgument("positions have the shape {} for images of {} pixels a side, "
                                   "expected [meshes, vertices, 3]",
                                   shape.ToString(), job.size));
    return {failed, failed};
  }
  return nn::WithFloatType(positions.dtype(), [&]<class T>(T) {
    return Render<T>(renderer, positions, colors, std::move(job));
  });
}

}  // namespace

RenderedImages RenderScenes(SceneRenderer& renderer, const SceneVars& scenes, RenderJob job) {
  if (!scenes.positions.valid()) return {scenes.positions, scenes.positions};
  return nn::WithFloatType(scenes.positions.dtype(),
                           [&]<class T>(T) { return Render<T>(renderer, scenes, std::move(job)); });
}

RenderedImages RenderRival(RivalRenderer& renderer, const nn::Var& positions, const nn::Var& colors,
                           RivalJob job) {
  return RenderChecked(renderer, positions, {colors}, std::move(job));
}

RenderedImages RenderTextured(RivalRenderer& renderer, const nn::Var& positions,
                              const nn::Var& textures, RivalJob job) {
  if (!textures.valid()) return {textures, textures};
  return RenderChecked(renderer, positions, {textures, true}, std::move(job));
}

}  // namespace tilegrad::train
