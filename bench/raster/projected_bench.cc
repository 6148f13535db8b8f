// SPDX-License-Identifier: Apache-2.0
// Faces that come projected (render/projected) and lists of the nearest faces
// (compat/pytorch3d_raster.h), float and double, one worker, against every face for every
// pixel in the same process. Counter: pixels a second.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <vector>

#include "compat/kaolin/face_visibility_ref.h"
#include "compat/kaolin/projected_raster.h"
#include "compat/pytorch3d_raster.h"
#include "raster/bench_scenes.h"
#include "raster/project.h"

namespace tilegrad::bench {
namespace {

namespace kaolin = compat::kaolin;
namespace pytorch3d = compat::pytorch3d;

constexpr std::size_t kChannels = 3;

// The scenes of a batch, projected; everything that the calls read and write.
template <class T>
struct ProjectedBench {
  explicit ProjectedBench(const SceneSpec& spec) : batch(spec) {
    raster.size = mask.size = {spec.size, spec.size};
    mask.delta = batch.options.delta;
    for (const Scene& scene : batch.scenes) Append(scene, spec.size);
    const std::size_t pixels = compat::PixelCount(raster.size) * batch.scenes.size();
    features.assign(z.size() * kChannels, T(0.5));
    d_features.resize(features.size());
    ids.resize(pixels);
    alpha.resize(pixels);
    d_alpha.assign(pixels, T(1));
    image.resize(pixels * kChannels);
    d_image.assign(image.size(), T(1));
    d_xy.resize(xy.size());
    failed = !Rasterize().ok() || !Soften().ok();
  }
  compat::ProjectedBatchT<T> View() const {
    return {batch.scenes.size(), z.size() / 3 / batch.scenes.size(), xy, z, {}};
  }
  Status Rasterize() {
    return kaolin::RasterizeProjected<T>(View(), raster, features, kChannels, one, ids, image);
  }
  Status RasterizeBack() {
    return kaolin::RasterizeProjectedBackward<T>(View(), raster, features, kChannels, one,
                                                 {ids, d_image, d_xy, d_features});
  }
  Status Soften() { return kaolin::ProjectedSoftMask<T>(View(), mask, ids, one, alpha).status(); }
  Status SoftenBack() {
    return kaolin::ProjectedSoftMaskBackward<T>(View(), mask, one, {ids, alpha, d_alpha, d_xy});
  }

  BenchBatch batch;
  Workers one{1};
  kaolin::ProjectedRasterOptions raster;
  kaolin::ProjectedMaskOptions mask;
  std::vector<T> xy, z, features, d_features, image, d_image, alpha, d_alpha, d_xy;
  std::vector<std::int32_t> ids;
  bool failed = false;

 private:
  void Append(const Scene& scene, int size) {
    raster::ScreenMeshBuffers buffers;
    raster::Project(FaceSourceOf(scene, batch.options), size, size, &buffers);
    const raster::ScreenMesh screen = buffers.View();
    for (std::size_t i = 0; i < 3 * screen.faces(); ++i) {
      const auto v = static_cast<std::size_t>(screen.vertex(i / 3, static_cast<int>(i % 3)));
      xy.push_back(T(2 * screen.x[v] / static_cast<float>(size) - 1));
      xy.push_back(T(1 - 2 * screen.y[v] / static_cast<float>(size)));
      z.push_back(T(-screen.depth[v]));
    }
  }
};

template <class Call>
void Measure(benchmark::State& state, std::size_t pixels, const Call& call) {
  for (auto _ : state) {
    if (!call().ok()) return state.SkipWithError("the call failed");
  }
  state.counters["pixels"] = benchmark::Counter(static_cast<double>(pixels),
                                                benchmark::Counter::kIsIterationInvariantRate);
}

template <class T>
void Projected(benchmark::State& state, const SceneSpec& spec,
               Status (ProjectedBench<T>::*call)()) {
  ProjectedBench<T> b(spec);
  if (b.failed) return state.SkipWithError("the scene did not render");
  Measure(state, b.ids.size(), [&] { return (b.*call)(); });
}

// Every face for every pixel of one row in the middle.
template <class T>
void NaiveVisibility(benchmark::State& state, const SceneSpec& spec) {
  const ProjectedBench<T> b(spec);
  const kaolin::PixelCentresT<T> pixels(spec.size, spec.size);
  Measure(state, pixels.width, [&] {
    for (std::size_t j = 0; j < pixels.width; ++j) {
      benchmark::DoNotOptimize(kaolin::FaceSeenRef(b.View().image(0), pixels.x[j],
                                                   pixels.y[pixels.height / 2], T(1e-14)));
    }
    return Status();
  });
}

// K nearest faces of the first image; the blur that goes with a width of 1e-4.
void Layers(benchmark::State& state, const SceneSpec& spec, int layers) {
  const ProjectedBench<float> b(spec);
  std::vector<float> vertices;
  for (std::size_t i = 0; i < b.View().faces * 3; ++i) {
    vertices.insert(vertices.end(), {-b.xy[2 * i], b.xy[2 * i + 1], -b.z[i]});
  }
  pytorch3d::LayeredOptions options;
  options.size = b.raster.size;
  options.faces_per_pixel = layers;
  options.blur_radius = 9.2e-4;
  options.rule.clip_barycentrics = true;
  const std::size_t n = compat::PixelCount(options.size) * static_cast<std::size_t>(layers);
  std::vector<std::int64_t> ids(n);
  std::vector<float> z(n), bary(3 * n), dists(n);
  const pytorch3d::FaceRange all[] = {{0, static_cast<std::int64_t>(b.View().faces)}};
  Measure(state, compat::PixelCount(options.size), [&] {
    return pytorch3d::RasterizeLayers<float>(vertices, all, options, b.one, {ids, z, bary, dists});
  });
}

template <class T>
void RegisterProjected(const std::string& scalar, const SceneSpec& spec) {
  using Bench = ProjectedBench<T>;
  const std::string name = std::string(spec.name) + "/" + scalar;
  const auto add = [&](const char* what, Status (Bench::*call)()) {
    benchmark::RegisterBenchmark((what + ("/" + name)).c_str(), Projected<T>, spec, call)
        ->Unit(benchmark::kMillisecond);
  };
  add("Rasterize", &Bench::Rasterize);
  add("RasterizeBackward", &Bench::RasterizeBack);
  add("SoftMask", &Bench::Soften);
  add("SoftMaskBackward", &Bench::SoftenBack);
  benchmark::RegisterBenchmark(("NaiveVisibility/" + name).c_str(), NaiveVisibility<T>, spec)
      ->Unit(benchmark::kMillisecond);
}

const bool kRegistered = [] {
  for (const SceneSpec& spec : {kScenes[0], kScenes[1], kScenes[2]}) {
    RegisterProjected<float>("float", spec);
    RegisterProjected<double>("double", spec);
    for (const int layers : {1, 8, 50}) {
      const std::string name = "Layers/" + std::string(spec.name) + "/" + std::to_string(layers);
      benchmark::RegisterBenchmark(name.c_str(), Layers, spec, layers)
          ->Unit(benchmark::kMillisecond);
    }
  }
  return true;
}();

}  // namespace
}  // namespace tilegrad::bench
