// SPDX-License-Identifier: Apache-2.0
#include "train/data/stream/textured_stream.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>

#include "base/clocks.h"
#include "base/error.h"
#include "render/picture/composite.h"
#include "render/picture/mesh_pictures.h"
#include "render/picture/mesh_scene.h"
#include "render/renderer.h"
#include "scene/camera_conventions.h"
#include "scene/light_frame.h"
#include "train/data/stream/object_draw.h"

namespace tilegrad::train {
namespace {

constexpr std::uint64_t kTexturedStream = 0x7465787475726564, kSceneStream = 0x7363656e65;

void RecolorAll(const Recolor& recolor, std::span<const float> from, std::vector<float>* to) {
  to->resize(from.size());
  for (std::size_t i = 0; i < from.size(); i += 3) {
    const glm::vec3 color = recolor({from[i], from[i + 1], from[i + 2]});
    for (int c = 0; c < 3; ++c) (*to)[i + static_cast<std::size_t>(c)] = color[c];
  }
}

// Colours are products: it is the texture that changes, or else the colours of vertices, or else
// the surface's own.
void RecolorSurface(const Recolor& recolor, bool has_colors, Surface* surface) {
  if (surface->texture >= 0 || has_colors) return;
  auto& base = surface->base_color;
  const glm::vec3 color = recolor({base[0], base[1], base[2]});
  for (int c = 0; c < 3; ++c) base[static_cast<std::size_t>(c)] = color[c];
}

}  // namespace

ConfigFields FieldsOf(TexturedStreamConfig* c) {
  ConfigFields fields = FieldsOf(&c->draw);
  std::erase_if(fields, [](const ConfigField& field) {
    return field.key == "stream.share" || field.key == "stream.max_faces" ||
           field.key == "stream.light" || field.key == "stream.cache";
  });
  fields.push_back({"stream.max_faces", &c->meshes.max_faces, 0, 1000000,
                    "of a mesh; larger ones are clustered; 0: none"});
  fields.push_back(CacheField(&c->meshes.cache));
  fields.push_back({"stream.max_texture", &c->meshes.max_texture, 1, 4096,
                    "largest texture of the source, texels a side; larger ones are averaged down"});
  fields.push_back({"stream.models", &c->meshes.folder, 0, 0,
                    "folder with the models of --source folder; \"\": the installed packages, or "
                    "else the dataset's coloured meshes",
                    Affects::kPlace});
  fields.push_back({"stream.crease", &c->meshes.crease, 0, 180,
                    "edges below this angle are shaded smoothly, degrees; 0: flat shading"});
  fields.push_back(
      {"stream.mirrored", &c->mirrored, 0, 1, "fraction of the objects mirrored left to right"});
  return fields;
}

TexturedStreamConfig WithoutChanges(TexturedStreamConfig config) {
  StreamConfig& draw = config.draw;
  draw.stretch = draw.taper = draw.recolor = draw.brightness = 0;
  config.mirrored = 0;
  return config;
}

struct TexturedStream::Worker {
  Workers alone{1};
  Renderer renderer = RendererOn(alone);
  Frame frame;
  MeshCache::Held held;  // to which the scenes refer
  std::vector<glm::vec3> positions;
  std::vector<float> colors;
  std::vector<std::vector<float>> texels;
  std::vector<Texture> textures;
  std::vector<Surface> surfaces, white;
  std::vector<Light> lights;
  std::vector<std::array<float, 9>> sh;
  std::vector<Scene> scenes, shown;  // without light, and as they are drawn
  std::vector<TexturedView> drawn;   // of SetUp, which passes them over
  std::vector<float> rgba;
  std::atomic<double> seconds = 0;

  void DrawColors(const Scene& scene, const Recolor& recolor);
  void SetViews(const Job& job, std::span<const TexturedView> views);
  void DrawViews(const Job& job, const Scene& object, std::span<TexturedView> views, Rng& rng);
  Status Take(const Job& job, Appearance appearance);
};

// The object's textures, surfaces and colours, into this memory.
void TexturedStream::Worker::DrawColors(const Scene& scene, const Recolor& recolor) {
  const std::size_t count = scene.textures.size();
  texels.resize(std::max(texels.size(), count));
  textures.assign(scene.textures.begin(), scene.textures.end());
  for (std::size_t t = 0; t < count; ++t) {
    RecolorAll(recolor, scene.textures[t].texels, &texels[t]);
    textures[t].texels = texels[t];
  }
  RecolorAll(recolor, scene.colors.values, &colors);
  surfaces.assign(scene.surfaces.begin(), scene.surfaces.end());
  for (Surface& surface : surfaces) RecolorSurface(recolor, !colors.empty(), &surface);
}

void TexturedStream::Worker::DrawViews(const Job& job, const Scene& object,
                                       std::span<TexturedView> views, Rng& rng) {
  const Surface under = job.dataset_light ? DatasetSurface() : SurfaceUnder(job.light);
  lights.assign(views.size(), {});
  if (job.dataset_light) {
    const std::array<Light, 2> two = DrawLights(job.config.draw, rng);
    lights.assign(two.begin(), two.end());
  }
  sh.resize(views.size());
  scenes.assign(views.size(), object);
  for (Surface& surface : surfaces) {
    surface.ambient = under.ambient;
    surface.diffuse = under.diffuse;
    surface.specular = under.specular;
  }
  // Shininess is one of the light's numbers here: one set of surfaces for each view.
  const std::size_t count = surfaces.size();
  surfaces.resize(count * views.size());
  for (std::size_t v = 0; v < views.size(); ++v) {
    views[v].camera = DrawCamera(job.config.draw, job.camera, job.dataset_light ? v : 0, rng);
    if (!job.dataset_light) views[v].light = DrawLight(job.light, rng);
    if (v > 0)
      std::copy_n(surfaces.begin(), count,
                  surfaces.begin() + static_cast<std::ptrdiff_t>(v * count));
    scenes[v].surfaces = std::span(surfaces).subspan(v * count, count);
  }
  SetViews(job, views);
}

// As many as there are scenes.
void TexturedStream::Worker::SetViews(const Job& job, std::span<const TexturedView> views) {
  const std::size_t count = surfaces.size() / scenes.size();
  for (std::size_t v = 0; v < scenes.size(); ++v) {
    const DrawnLight& light = views[v].light;
    scenes[v].camera = ScaledCamera(views[v].camera, static_cast<float>(job.config.draw.samples));
    if (job.dataset_light) continue;
    lights[v].direction = DirectionToWorld(light.direction, views[v].camera);
    sh[v] = HarmonicsToWorld(light.sh, views[v].camera);
    for (std::size_t s = v * count; s < (v + 1) * count; ++s)
      surfaces[s].shininess = light.shininess;
  }
}

// Pictures of `shown` into `rgba`.
Status TexturedStream::Worker::Take(const Job& job, Appearance appearance) {
  const auto samples = static_cast<int>(job.config.draw.samples);
  const RenderOptions options{.width = samples * job.size, .height = samples * job.size};
  TILEGRAD_TRY(renderer.Render(shown, options, OutputsOf(appearance), &frame));
  const std::size_t image =
      4 * static_cast<std::size_t>(job.size) * static_cast<std::size_t>(job.size);
  rgba.resize(image * shown.size());
  for (std::size_t v = 0; v < shown.size(); ++v)
    AverageSamples(frame.images(), v, samples, std::span(rgba).subspan(v * image, image));
  return {};
}

TexturedStream::TexturedStream(const Job& job, MeshCache meshes, std::size_t lanes)
    : job_(job), meshes_(std::move(meshes)) {
  for (std::size_t w = 0; w < lanes; ++w) workers_.push_back(std::make_unique<Worker>());
}

TexturedStream::~TexturedStream() = default;
TexturedStream::TexturedStream(TexturedStream&&) noexcept = default;

std::size_t TexturedStream::Count(std::size_t batch) const {
  return static_cast<std::size_t>(std::lround(job_.config.draw.share * static_cast<double>(batch)));
}

void TexturedStream::Expect(std::span<const Sample> objects) const {
  std::vector<std::size_t> indices;
  for (const Sample& object : objects) indices.push_back(static_cast<std::size_t>(object.model));
  meshes_.Expect(indices);
}

// Everything that is drawn by lot.
Status TexturedStream::Place(int model, std::uint64_t position, Worker* worker,
                             std::span<TexturedView> views) {
  Worker& w = *worker;
  TILEGRAD_ASSIGN(w.held, meshes_.Get(static_cast<std::size_t>(model)));
  const TexturedMesh& mesh = *w.held;
  Rng rng(job_.seed ^ (job_.dataset_light ? kSceneStream : kTexturedStream), position);
  DrawShape(job_.config.draw, mesh.mesh().positions, static_cast<float>(job_.camera.half_extent),
            rng, &w.positions);
  if (!job_.dataset_light && rng.Uniform() < job_.config.mirrored) {
    for (glm::vec3& p : w.positions) p.x = -p.x;
  }
  w.DrawColors(mesh.scene(), Recolor(job_.config.draw, rng));
  Scene object = mesh.scene();
  object.positions = Flat(w.positions);
  object.textures = w.textures;
  object.colors.values = w.colors;
  w.DrawViews(job_, object, views, rng);
  return {};
}

Result<std::span<const float>> TexturedStream::Render(int model, std::uint64_t position,
                                                      std::size_t worker,
                                                      std::span<TexturedView> views) {
  const double start = ThreadSeconds();
  Worker& w = *workers_[worker];
  TILEGRAD_TRY(Place(model, position, &w, views));
  TILEGRAD_TRY(Again(worker, Appearance::kLit).status());
  w.seconds += ThreadSeconds() - start;
  return std::span<const float>(w.rgba);
}

Status TexturedStream::SetUp(int model, std::uint64_t position, std::size_t worker,
                             std::span<const TexturedView> views) {
  Worker& w = *workers_[worker];
  w.drawn.resize(views.size());
  TILEGRAD_TRY(Place(model, position, &w, w.drawn));
  return Change(worker, views);
}

Result<std::span<const float>> TexturedStream::Again(std::size_t worker, Appearance appearance) {
  Worker& w = *workers_[worker];
  const Lighting of_job = job_.dataset_light ? Lighting::kLambert : LightingOf(job_.light);
  const Lighting lighting = IsLit(appearance) ? of_job : Lighting::kNone;
  w.shown = w.scenes;
  w.white = w.surfaces;
  for (Surface& surface : w.white) {
    surface.base_color = {1, 1, 1};
    surface.texture = -1;
  }
  for (std::size_t v = 0; v < w.shown.size(); ++v) {
    Scene& scene = w.shown[v];
    scene.shading.lighting = lighting;
    if (lighting == Lighting::kLambert || lighting == Lighting::kPhong)
      scene.lights = job_.dataset_light ? std::span<const Light>(w.lights)
                                        : std::span<const Light>(&w.lights[v], 1);
    if (lighting == Lighting::kSphericalHarmonics) scene.sh = w.sh[v];
    if (appearance != Appearance::kLight) continue;
    const std::size_t count = scene.surfaces.size();
    scene.surfaces = std::span(w.white).subspan(v * count, count);
    scene.colors = {};
    scene.textures = {};
    scene.uvs = {};
  }
  TILEGRAD_TRY(w.Take(job_, appearance));
  return std::span<const float>(w.rgba);
}

Status TexturedStream::Change(std::size_t worker, std::span<const TexturedView> views) {
  Worker& w = *workers_[worker];
  if (views.size() != w.scenes.size())
    return InvalidArgument("{} views were drawn, and {} are given", w.scenes.size(), views.size());
  w.SetViews(job_, views);
  return {};
}

double TexturedStream::TakeSeconds() {
  double sum = 0;
  for (const auto& worker : workers_) sum += worker->seconds.exchange(0);
  return sum;
}

Result<ImageU8> TexturedStream::Sheet(int objects, int views) {
  const auto count = static_cast<std::size_t>(objects);
  const std::size_t plane =
      static_cast<std::size_t>(job_.size) * static_cast<std::size_t>(job_.size);
  std::vector<TexturedView> drawn(static_cast<std::size_t>(views));
  std::vector<ImageU8> pictures;
  for (std::size_t i = 0; i < count; ++i) {
    const auto model = static_cast<int>(i * meshes_.size() / count);
    TILEGRAD_ASSIGN(const auto rgba, Render(model, i, 0, drawn));
    for (std::size_t v = 0; v < drawn.size(); ++v)
      pictures.push_back(OnPaper(rgba.subspan(4 * plane * v, 4 * plane), job_.size));
  }
  return TileImages(pictures, views);
}

}  // namespace tilegrad::train
