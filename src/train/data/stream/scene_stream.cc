// SPDX-License-Identifier: Apache-2.0
#include "train/data/stream/scene_stream.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <utility>

#include "base/error.h"
#include "base/processor_time.h"
#include "render/picture/composite.h"
#include "render/picture/dataset_light.h"
#include "render/renderer.h"
#include "scene/camera_conventions.h"
#include "train/data/build/truth_mesh.h"
#include "train/data/stream/average_samples.h"
#include "train/data/stream/view_draw.h"

namespace tilegrad::train {
namespace {

constexpr std::uint64_t kSceneStream = 0x7363656e65;

ColoredMesh Stripped(const Mesh& truth, std::int64_t max_faces) {
  const Mesh small = MakeTruthMesh(truth, static_cast<std::size_t>(max_faces));
  ColoredMesh out{small.positions, {}, small.faces};
  for (const glm::vec4& color : small.colors) out.colors.emplace_back(color);
  return out;
}

std::size_t BytesOf(const ColoredMesh& mesh) {
  return mesh.positions.size() * 2 * sizeof(glm::vec3) + mesh.faces.size() * sizeof(Face);
}

Result<ColoredMesh> LoadOne(const Dataset& dataset, int model, std::int64_t max_faces) {
  TILEGRAD_ASSIGN(const ModelData data, dataset.Load(model));
  if (data.mesh.faces.empty()) {
    return InvalidArgument("{}: has no mesh to render; set stream.share to 0",
                           dataset.ModelPath(model).string());
  }
  return Stripped(data.mesh, max_faces);
}

}  // namespace

Result<std::vector<ColoredMesh>> LoadStreamMeshes(const Dataset& dataset,
                                                  const std::vector<int>& models,
                                                  std::int64_t max_faces, const Workers& workers,
                                                  const ProgressSink& progress,
                                                  const StopFlag& stop) {
  std::vector<ColoredMesh> out(models.size());
  std::vector<Status> failures(models.size());
  std::mutex mutex;
  std::uint64_t done = 0;
  std::size_t bytes = 0;
  workers.For(models.size(), [&](std::size_t i, std::size_t) {
    if (stop) return;
    auto mesh = LoadOne(dataset, models[i], max_faces);
    failures[i] = mesh.status();
    if (mesh.ok()) out[i] = *std::move(mesh);
    const std::scoped_lock lock(mutex);
    bytes += BytesOf(out[i]);
    if (progress)
      progress({"loading meshes", ++done, models.size(), fmt::format("{:.1f} MB", bytes / 1e6)});
  });
  if (stop) return Cancelled("stopped while loading the dataset");
  for (const Status& failure : failures) TILEGRAD_TRY(failure);
  return out;
}

struct SceneStream::Worker {
  Workers alone{1};
  Renderer renderer = RendererOn(alone);
  Frame frame;
  ObjectDraw object;
  std::vector<Scene> scenes;
  std::vector<float> rgba;
  double seconds = 0;
};

SceneStream::SceneStream(const StreamConfig& config, std::vector<ColoredMesh> meshes,
                         const DatasetInfo& info, std::uint64_t seed, const Workers& workers)
    : config_(config),
      meshes_(std::move(meshes)),
      rule_(info.camera),
      size_(info.image_size),
      seed_(seed) {
  for (int w = 0; w < workers.count(); ++w) workers_.push_back(std::make_unique<Worker>());
}
SceneStream::~SceneStream() = default;
SceneStream::SceneStream(SceneStream&&) noexcept = default;

std::size_t SceneStream::Count(std::size_t batch) const {
  return static_cast<std::size_t>(std::lround(config_.share * static_cast<double>(batch)));
}

Result<std::span<const float>> SceneStream::Render(int model, std::uint64_t position,
                                                   std::size_t worker, std::span<Camera> cameras) {
  const double start = ThreadSeconds();
  Worker& w = *workers_[worker];
  const ColoredMesh& mesh = meshes_[static_cast<std::size_t>(model)];
  Rng rng(seed_ ^ kSceneStream, position);
  DrawObject(config_, mesh, static_cast<float>(rule_.half_extent), rng, &w.object);
  const std::array<Light, 2> lights = DrawLights(config_, rng);
  const Surface surface = DatasetSurface();
  const auto samples = static_cast<int>(config_.samples);
  w.scenes.assign(cameras.size(), {});
  for (std::size_t v = 0; v < w.scenes.size(); ++v) {
    Scene& scene = w.scenes[v];
    cameras[v] = DrawCamera(config_, rule_, v, rng);
    scene.camera = ScaledCamera(cameras[v], static_cast<float>(samples));
    scene.positions = Flat(w.object.positions);
    scene.faces = {mesh.faces[0].data(), 3 * mesh.faces.size()};
    scene.colors = {Flat(w.object.colors), Rate::kVertex};
    scene.surfaces = {&surface, 1};
    scene.shading = {.lighting = Lighting::kLambert, .normals = Normals::kFlat, .two_sided = true};
    scene.lights = lights;
  }
  const RenderOptions options{.width = samples * size_, .height = samples * size_};
  const Outputs outputs{.color = true, .alpha = false, .attributes = false};
  TILEGRAD_TRY(w.renderer.Render(w.scenes, options, outputs, &w.frame));
  const std::size_t image = 4 * static_cast<std::size_t>(size_) * static_cast<std::size_t>(size_);
  w.rgba.resize(image * cameras.size());
  for (std::size_t v = 0; v < cameras.size(); ++v)
    AverageSamples(w.frame.images(), v, samples, std::span(w.rgba).subspan(v * image, image));
  w.seconds += ThreadSeconds() - start;
  return std::span<const float>(w.rgba);
}

double SceneStream::TakeSeconds() {
  double sum = 0;
  for (const auto& worker : workers_) sum += std::exchange(worker->seconds, 0);
  return sum;
}

Result<ImageU8> SceneStream::Sheet(int objects, int views) {
  const auto count = static_cast<std::size_t>(objects), models = meshes_.size();
  const std::size_t plane = static_cast<std::size_t>(size_) * static_cast<std::size_t>(size_);
  std::vector<Camera> cameras(static_cast<std::size_t>(views));
  std::vector<ImageU8> pictures;
  for (std::size_t i = 0; i < count; ++i) {
    TILEGRAD_ASSIGN(const auto rgba, Render(static_cast<int>(i * models / count), i, 0, cameras));
    for (std::size_t v = 0; v < cameras.size(); ++v) {
      const auto image = rgba.subspan(4 * plane * v, 4 * plane);
      pictures.push_back(OverGrey(
          PlanarRgba<float>{image.first(3 * plane), image.subspan(3 * plane), size_, size_},
          kPaper));
    }
  }
  return TileImages(pictures, views);
}

}  // namespace tilegrad::train
