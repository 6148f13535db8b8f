// SPDX-License-Identifier: Apache-2.0
// The soft mask alone, on one image of each scene: all tiles, one worker, against the scalar
// reference over all faces for a few rows in the same process. Counters: background pixels a
// second, pairs of pixel and face a second, alpha error bound spent.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <numeric>

#include "raster/bench_scenes.h"
#include "raster/project.h"
#include "raster/soft_mask/soft_mask.h"
#include "raster/soft_mask/soft_mask_ref.h"

namespace tilegrad::bench {
namespace {

// Image 0 of a scene on the screen, with what the soft mask reads.
struct SoftBench {
  SoftBench(const SceneSpec& spec, double delta, double error) : batch(spec) {
    batch.options.delta = delta;
    batch.options.max_alpha_error = error;
    raster::Project(FaceSourceOf(batch.scenes[0], batch.options), spec.size, spec.size, &buffers);
    mesh = buffers.View();
    grid = raster::BinGrid(spec.size, spec.size);
    Workers one(1);
    Pipeline renderer(one);
    SizeFrame(1, 0, batch.options, {.color = false, .alpha = false, .attributes = false}, &frame);
    renderer.Render({batch.views.data(), 1}, batch.options, {}, &frame);
    Build();
    alpha.resize(frame.face_ids.size());
    transmittance.resize(alpha.size());
  }
  void Build() {
    raster::SetUpFaces(mesh, /*cull_back=*/false, buffers.reject, {.corners = &tree.corners});
    raster::BuildSoftTree(&tree);
    plan = raster::PlanSoftMask(
        {grid.width, grid.height, batch.options.delta, batch.options.max_alpha_error, tree.faces});
  }
  raster::SoftMaskRegion Bin(std::size_t t) const { return {grid.rect(t), frame.face_ids}; }
  raster::SoftMaskImages Images() { return {alpha, transmittance}; }
  // Calls visit(pixel) for the background pixels of every `step`th row.
  template <class Visit>
  void ForPixels(int step, const Visit& visit) const {
    for (int y = step / 2; y < grid.height; y += step) {
      for (int x = 0; x < grid.width; ++x) {
        const auto i = static_cast<std::size_t>(y * grid.width + x);
        if (frame.face_ids[i] < 0) visit(i);
      }
    }
  }
  void Count(benchmark::State& state, int step) const {
    double pixels = 0;
    ForPixels(step, [&](std::size_t) { pixels += 1; });
    state.counters["pixels"] =
        benchmark::Counter(pixels, benchmark::Counter::kIsIterationInvariantRate);
    state.counters["pairs"] = benchmark::Counter(pixels * static_cast<double>(tree.faces),
                                                 benchmark::Counter::kIsIterationInvariantRate);
  }

  BenchBatch batch;
  raster::ScreenMeshBuffers buffers;
  raster::ScreenMesh mesh;
  FrameImages frame;
  raster::SoftMaskPlan plan;
  raster::SquareGrid grid;
  raster::SoftTree tree;
  std::vector<float> alpha, transmittance;
  AlignedVector<raster::SoftFaceGradient> gradients;
  raster::SoftMaskScratch scratch;
};

void SoftForward(benchmark::State& state, const SceneSpec& spec, double delta, double error) {
  SoftBench b(spec, delta, error);
  double spent = 0;
  for (auto _ : state) {
    b.Build();
    for (std::size_t t = 0; t < b.grid.cells(); ++t) {
      spent = std::max(spent, SoftMaskForward(b.tree, b.plan, b.Bin(t), b.Images(), &b.scratch));
    }
  }
  b.Count(state, 1);
  state.counters["spent"] = spent;
}

void SoftBackward(benchmark::State& state, const SceneSpec& spec, double delta, double error) {
  SoftBench b(spec, delta, error);
  const auto d_alpha = std::span<const float>(b.batch.d_alpha).first(b.alpha.size());
  for (std::size_t t = 0; t < b.grid.cells(); ++t) {
    SoftMaskForward(b.tree, b.plan, b.Bin(t), b.Images(), &b.scratch);
  }
  for (auto _ : state) {
    b.gradients.clear();
    for (std::size_t t = 0; t < b.grid.cells(); ++t) {
      SoftMaskBackward(b.tree, b.plan, b.Bin(t), {b.alpha, b.transmittance, d_alpha}, &b.gradients,
                       &b.scratch);
    }
  }
  b.Count(state, 1);
}

// All faces for the pixels of a few rows.
void SoftReference(benchmark::State& state, const SceneSpec& spec, double delta, double error) {
  SoftBench b(spec, delta, error);
  const float size = static_cast<float>(spec.size);
  const raster::SoftScale<float> scale{2 / size, 2 / size, static_cast<float>(1 / delta)};
  std::vector<std::int32_t> faces(b.mesh.faces());
  std::iota(faces.begin(), faces.end(), 0);
  const int step = spec.size / 4;
  for (auto _ : state) {
    b.ForPixels(step, [&](std::size_t i) {
      const auto n = static_cast<std::size_t>(spec.size);
      b.alpha[i] = raster::SoftAlphaRef<float>(b.mesh, faces, static_cast<float>(i % n) + 0.5f,
                                               static_cast<float>(i / n) + 0.5f, scale);
    });
  }
  b.Count(state, step);
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
