// SPDX-License-Identifier: Apache-2.0
// The soft mask alone, on one image of each scene: binning and all tiles, one worker, against the
// scalar reference over the same lists in the same process. Counters: pixels evaluated a second
// (background pixels in tiles that list faces), pairs of pixel and listed face a second, alpha
// error bound spent.
#include <benchmark/benchmark.h>

#include <algorithm>

#include "raster/bench_scenes.h"
#include "raster/project.h"
#include "raster/soft_mask.h"
#include "raster/soft_mask_ref.h"
#include "render/frame_layout.h"

namespace tilegrad::bench {
namespace {

// Image 0 of a scene on the screen, with what the soft mask reads.
struct SoftBench {
  SoftBench(const SceneSpec& spec, double delta, double error) : batch(spec) {
    batch.options.delta = delta, batch.options.max_alpha_error = error;
    const SceneView& scene = batch.scenes[0];
    raster::Project(FaceSourceOf(scene, batch.options), spec.size, spec.size, &buffers);
    mesh = buffers.View();
    Workers one(1);
    Renderer renderer(one);
    const Status status =
        renderer.Render({&scene, 1}, batch.options, {false, false, false, false}, &frame);
    failed = !status.ok();
    plan = raster::PlanSoftMask({spec.size, spec.size, delta, error, raster::CountSoftFaces(mesh)});
    grid = raster::TileGrid(spec.size, spec.size);
    alpha.resize(frame.face_ids.size());
  }
  void Bin() {
    lists = raster::BinSoftFaces(mesh, grid, plan.margin_x, plan.margin_y, &list_buffers);
  }
  raster::SoftMaskTile Tile(std::size_t t) const {
    return {grid.rect(t), lists[t], raster::BinnedError(plan, lists[t].size()), frame.face_ids};
  }
  // Calls visit(tile, pixel) for every background pixel of a tile that lists faces.
  template <class Visit>
  void ForPixels(const Visit& visit) const {
    for (std::size_t t = 0; t < grid.tiles(); ++t) {
      const raster::TileRect r = grid.rect(t);
      if (lists[t].empty()) continue;
      for (int y = r.y0; y < r.y1; ++y) {
        for (int x = r.x0; x < r.x1; ++x) {
          const auto i = static_cast<std::size_t>(y * grid.width + x);
          if (frame.face_ids[i] < 0) visit(t, i);
        }
      }
    }
  }
  void Count(benchmark::State& state) const {
    double pixels = 0, pairs = 0;
    ForPixels([&](std::size_t t, std::size_t) {
      pixels += 1, pairs += static_cast<double>(lists[t].size());
    });
    state.counters["pixels"] =
        benchmark::Counter(pixels, benchmark::Counter::kIsIterationInvariantRate);
    state.counters["pairs"] =
        benchmark::Counter(pairs, benchmark::Counter::kIsIterationInvariantRate);
  }

  BenchBatch batch;
  raster::ScreenMeshBuffers buffers;
  raster::ScreenMesh mesh;
  Frame frame;
  bool failed = false;
  raster::SoftMaskPlan plan;
  raster::TileGrid grid;
  raster::TileListBuffers list_buffers;
  raster::TileLists lists;
  std::vector<float> alpha, d_corners;
  raster::SoftMaskScratch scratch;
};

void SoftForward(benchmark::State& state, const SceneSpec& spec, double delta, double error) {
  SoftBench b(spec, delta, error);
  if (b.failed) return state.SkipWithError("the scene did not render");
  double spent = 0;
  for (auto _ : state) {
    b.Bin();
    for (std::size_t t = 0; t < b.grid.tiles(); ++t) {
      spent = std::max(spent, SoftMaskForward(b.mesh, b.plan, b.Tile(t), b.alpha, &b.scratch));
    }
  }
  b.Count(state);
  state.counters["spent"] = spent;
}

void SoftBackward(benchmark::State& state, const SceneSpec& spec, double delta, double error) {
  SoftBench b(spec, delta, error);
  if (b.failed) return state.SkipWithError("the scene did not render");
  const auto d_alpha = std::span<const float>(b.batch.d_alpha).first(b.alpha.size());
  for (auto _ : state) {
    b.Bin();
    for (std::size_t t = 0; t < b.grid.tiles(); ++t) {
      b.d_corners.resize(6 * b.lists[t].size());
      SoftMaskBackward(b.mesh, b.plan, b.Tile(t), d_alpha, b.d_corners, &b.scratch);
    }
  }
  b.Count(state);
}

void SoftReference(benchmark::State& state, const SceneSpec& spec, double delta, double error) {
  SoftBench b(spec, delta, error);
  if (b.failed) return state.SkipWithError("the scene did not render");
  const float size = static_cast<float>(spec.size);
  const raster::SoftScale<float> scale{2 / size, 2 / size, static_cast<float>(1 / delta)};
  for (auto _ : state) {
    b.Bin();
    b.ForPixels([&](std::size_t t, std::size_t i) {
      const auto n = static_cast<std::size_t>(spec.size);
      b.alpha[i] = raster::SoftAlphaRef<float>(b.mesh, b.lists[t], static_cast<float>(i % n) + 0.5f,
                                               static_cast<float>(i / n) + 0.5f, scale);
    });
  }
  b.Count(state);
}

const bool kRegistered = [] {
  struct Setting {
    const char* name;
    double delta, error;
  };
  static constexpr Setting kSettings[] = {{"default", 1.0 / 7000, 1e-6},
                                          {"coarse", 1.0 / 7000, 1e-3},
                                          {"exact", 1.0 / 7000, 0},
                                          {"wide", 1e-2, 1e-3}};
  for (const SceneSpec& spec : kScenes) {
    if (spec.name == std::string("Training")) continue;  // S1 again, more images
    for (const Setting& s : kSettings) {
      const auto add = [&](const char* what, auto run) {
        benchmark::RegisterBenchmark(
            (std::string(spec.name) + "/" + s.name + "/" + what).c_str(),
            [&spec, &s, run](benchmark::State& state) { run(state, spec, s.delta, s.error); })
            ->Unit(benchmark::kMillisecond);
      };
      add("forward", SoftForward);
      add("backward", SoftBackward);
      add("reference_forward", SoftReference);
    }
  }
  return true;
}();

}  // namespace
}  // namespace tilegrad::bench
