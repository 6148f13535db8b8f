// SPDX-License-Identifier: Apache-2.0
// Alpha and its gradient by each rule that training knows (render.rule), on scene S1: 64 images of
// 64 x 64, 1,280 faces each. Beside them the scalar references of the rivals on one image in the
// same process: a ratio times 64 is what the fast code gains.
//
// With `color`, colours and alpha together: softmax over vertex colours, and N3MR's joint sweep.
//
// Names: rule/direction/who, who being a number of workers, or `reference` (one image).
#include <benchmark/benchmark.h>

#include <span>
#include <string>

#include "raster/bench_scenes.h"
#include "rivals/face_corners.h"
#include "rivals/n3mr_ref.h"
#include "rivals/renderer.h"
#include "rivals/softras_ref.h"

namespace tilegrad::bench {
namespace {

void Check(const Status& status, benchmark::State& state) {
  if (!status.ok()) state.SkipWithError(status.message().c_str());
}

// One view each of as many meshes as there are images.
struct RivalBench {
  BenchBatch batch{kScenes[0]};
  std::vector<float> positions, colors, alpha, color, d_color, d_positions, d_colors;
  std::vector<Camera> cameras;

  explicit RivalBench(bool with_color = false) {
    for (const Scene& scene : batch.scenes) {
      positions.insert(positions.end(), scene.positions.begin(), scene.positions.end());
      cameras.push_back(scene.camera);
    }
    alpha.resize(batch.d_alpha.size());
    d_positions.resize(positions.size());
    if (!with_color) return;
    while (colors.size() < positions.size())
      colors.insert(colors.end(), batch.colors.begin(), batch.colors.end());
    color.resize(3 * alpha.size());
    d_colors.resize(colors.size());
    for (int c = 0; c < 3; ++c)
      d_color.insert(d_color.end(), batch.d_alpha.begin(), batch.d_alpha.end());
  }
  rivals::BatchT<float> View() const {
    return {positions, colors, batch.faces, cameras, cameras.size(), kScenes[0].size};
  }
  // Corners of the first image's faces.
  std::vector<float> FirstCorners() const {
    const std::size_t numbers = batch.scenes[0].positions.size();
    std::vector<float> points(numbers), corners;
    rivals::ProjectVertices<float>(cameras[0], kScenes[0].size, batch.scenes[0].positions, points);
    for (const std::int32_t v : batch.faces) {
      const auto from = points.begin() + 3 * v;
      corners.insert(corners.end(), from, from + 3);
    }
    return corners;
  }
  std::span<const float> FirstPush() const {
    return std::span(batch.d_alpha).first(View().pixels());
  }
};

enum class Way { kForward, kBackward };

struct RivalRun {
  std::string name;
  rivals::Options options;
  bool color = false;
};

void Rival(benchmark::State& state, const RivalRun& run, Way way, int count) {
  RivalBench bench(run.color);
  const Workers workers(count);
  rivals::Renderer renderer(workers);
  const auto forward = [&] {
    Check(renderer.Render(bench.View(), run.options, {bench.alpha, bench.color}), state);
  };
  const auto backward = [&] {
    Check(renderer.Backward(bench.View(), run.options, {bench.batch.d_alpha, bench.d_color},
                            {bench.d_positions, bench.d_colors}),
          state);
  };
  forward();
  backward();  // which find their memory
  for (auto _ : state) way == Way::kForward ? forward() : backward();
  state.counters["images"] = kScenes[0].images;
}

// As training does: delta 1/7000, max_alpha_error 1e-5.
void Dibr(benchmark::State& state, Way way, int count) {
  RivalBench bench;
  bench.batch.options.delta = 1.0 / 7000;
  bench.batch.options.max_alpha_error = 1e-5;
  const Workers workers(count);
  Pipeline renderer(workers);
  FrameImages frame;
  const auto forward = [&] {
    Draw(bench.batch, {.color = false, .attributes = false}, &renderer, &frame);
  };
  const auto backward = [&] {
    if (renderer.Backward(bench.batch.views, bench.batch.options, frame, {{}, bench.batch.d_alpha},
                          bench.batch.d_scenes)) {
      return;
    }
    state.SkipWithError("a gradient is not finite");
  };
  forward();
  backward();
  for (auto _ : state) way == Way::kForward ? forward() : backward();
  state.counters["images"] = kScenes[0].images;
}

void Reference(benchmark::State& state, const rivals::Options& options, Way way) {
  RivalBench bench;
  const std::vector<float> corners = bench.FirstCorners();
  std::vector<float> d_corners(corners.size());
  const std::span<float> alpha = std::span(bench.alpha).first(bench.View().pixels());
  const int size = kScenes[0].size;
  const bool soft = options.rule == rivals::Rule::kSoftRas;
  for (auto _ : state) {
    if (way == Way::kForward) {
      soft ? rivals::SoftRasForwardRef<float>(corners, size, options.softras, alpha)
           : rivals::N3mrForwardRef<float>(corners, size, options.n3mr, alpha);
    } else {
      soft ? rivals::SoftRasBackwardRef<float>(corners, size, options.softras, bench.FirstPush(),
                                               d_corners)
           : rivals::N3mrBackwardRef<float>(corners, size, options.n3mr, bench.FirstPush(),
                                            d_corners);
    }
  }
  state.counters["images"] = 1;
}

template <class Run>
void Register(const std::string& name, const Run& run) {
  benchmark::RegisterBenchmark(name.c_str(), run)->Unit(benchmark::kMillisecond)->UseRealTime();
}

void RegisterAll() {
  const rivals::Options soft, n3mr{.rule = rivals::Rule::kN3mr};
  const RivalRun runs[] = {
      {"softras", soft}, {"n3mr", n3mr}, {"softras_color", soft, true}, {"n3mr_color", n3mr, true}};
  for (const Way way : {Way::kForward, Way::kBackward}) {
    const std::string direction = way == Way::kForward ? "/forward/" : "/backward/";
    for (const int count : {1, 2}) {
      const std::string who = direction + std::to_string(count);
      Register("dibr" + who, [=](benchmark::State& state) { Dibr(state, way, count); });
      for (const RivalRun& run : runs) {
        Register(run.name + who, [=](benchmark::State& state) { Rival(state, run, way, count); });
        if (count != 1 || run.color) continue;
        Register(run.name + direction + "reference",
                 [=](benchmark::State& state) { Reference(state, run.options, way); });
      }
    }
  }
}

const bool kRegistered = [] {
  RegisterAll();
  return true;
}();

}  // namespace
}  // namespace tilegrad::bench
