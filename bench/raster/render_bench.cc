// SPDX-License-Identifier: Apache-2.0
// Forward and backward of whole batches, beside the naive reference in the same process. The naive
// renderer runs on a sample of rows of the first image, so compare images per second. One worker
// unless the name says two.
#include <benchmark/benchmark.h>

#include <cstdlib>

#include "raster/bench_scenes.h"
#include "render/renderer_ref.h"

namespace tilegrad::bench {
namespace {

void Check(const Status& status, benchmark::State& state) {
  if (!status.ok()) state.SkipWithError(status.message().c_str());
}

// Images per second, of the whole batch or of a sample that makes `images` images.
void CountImages(benchmark::State& state, double images) {
  state.counters["images"] =
      benchmark::Counter(images, benchmark::Counter::kIsIterationInvariantRate);
}

// What is rendered, and on how many workers.
struct RunSpec {
  SceneSpec scene;
  bool color = true, alpha = true;
  int workers = 1;
  Interpolation interpolation = Interpolation::kScreenLinear;

  RenderRequest request() const { return {color, alpha, false, false}; }
  CulledParts parts() const { return {color, alpha}; }
};

BenchBatch MakeBatch(const RunSpec& spec) {
  BenchBatch batch(spec.scene);
  batch.options.interpolation = spec.interpolation;
  return batch;
}

void Forward(benchmark::State& state, const RunSpec& spec) {
  const BenchBatch batch = MakeBatch(spec);
  const Workers workers(spec.workers);
  Renderer renderer(workers);
  Frame frame;
  for (auto _ : state) {
    Check(renderer.Render(batch.scenes, batch.options, spec.request(), &frame), state);
  }
  CountImages(state, spec.scene.images);
}

void Backward(benchmark::State& state, const RunSpec& spec) {
  BenchBatch batch = MakeBatch(spec);
  const Workers workers(spec.workers);
  Renderer renderer(workers);
  Frame frame;
  Check(renderer.Render(batch.scenes, batch.options, {}, &frame), state);
  FrameGradients d_frame;
  if (spec.color) d_frame.attributes = batch.d_attributes;
  if (spec.alpha) d_frame.alpha = batch.d_alpha;
  for (auto _ : state) {
    Check(renderer.Backward(batch.scenes, batch.options, frame, d_frame, batch.d_scenes), state);
  }
  CountImages(state, spec.scene.images);
}

void RunCulledForward(benchmark::State& state, const RunSpec& spec) {
  CulledBatch culled(MakeBatch(spec));
  for (auto _ : state) culled.Forward(spec.parts());
  CountImages(state, spec.scene.images);
}

void RunCulledBackward(benchmark::State& state, const RunSpec& spec) {
  CulledBatch culled(MakeBatch(spec));
  culled.Forward({});
  for (auto _ : state) culled.Backward(spec.parts());
  CountImages(state, spec.scene.images);
}

// Two middle rows: half of the pixels covered, as on average.
RowRange SampleRows(const SceneSpec& spec) {
  return {spec.size / 4, spec.size / 4 + (spec.level > 3 ? 1 : 2)};
}

double SampledImages(const SceneSpec& spec) {
  const RowRange rows = SampleRows(spec);
  return static_cast<double>(rows.end - rows.begin) / spec.size;
}

void NaiveForward(benchmark::State& state, const SceneSpec& spec) {
  const BenchBatch batch(spec);
  Frame frame;
  for (auto _ : state) {
    const auto ids = FaceIdsRef(batch.scenes[0], batch.options, SampleRows(spec));
    RenderRefWithFaces<float>(batch.scenes[0], batch.options, {}, ids, SampleRows(spec), &frame);
  }
  CountImages(state, SampledImages(spec));
}

void NaiveBackward(benchmark::State& state, const SceneSpec& spec) {
  BenchBatch batch(spec);
  const auto ids = FaceIdsRef(batch.scenes[0], batch.options, SampleRows(spec));
  for (auto _ : state) {
    RenderRefBackward<float>(batch.scenes[0], batch.options, ids,
                             {batch.d_attributes, batch.d_alpha}, SampleRows(spec),
                             &batch.d_scenes[0]);
  }
  CountImages(state, SampledImages(spec));
}

void Add(const std::string& name, const RunSpec& spec,
         void (*run)(benchmark::State&, const RunSpec&)) {
  benchmark::RegisterBenchmark(name.c_str(),
                               [spec, run](benchmark::State& state) { run(state, spec); })
      ->Unit(benchmark::kMillisecond)
      ->MeasureProcessCPUTime()
      ->UseRealTime();
}

void AddNaive(const SceneSpec& scene) {
  const std::string name = scene.name;
  const auto add = [&](const char* what, void (*run)(benchmark::State&, const SceneSpec&)) {
    benchmark::RegisterBenchmark((name + what).c_str(),
                                 [scene, run](benchmark::State& state) { run(state, scene); })
        ->Unit(benchmark::kMillisecond)
        ->MeasureProcessCPUTime()
        ->UseRealTime();
  };
  add("/forward/both/naive", NaiveForward), add("/backward/both/naive", NaiveBackward);
}

// Names: scene/direction/what/who, who being a number of workers, `culled` or `naive`.
const bool kRegistered = [] {
  for (const SceneSpec& scene : kScenes) {
    const std::string name = scene.name;
    const auto all = [&](const std::string& what, bool color, bool alpha) {
      Add(name + "/forward/" + what + "/culled", {scene, color, alpha}, RunCulledForward);
      Add(name + "/backward/" + what + "/culled", {scene, color, alpha}, RunCulledBackward);
      for (const int workers : {1, 2}) {
        const std::string who = "/" + std::to_string(workers);
        Add(name + "/forward/" + what + who, {scene, color, alpha, workers}, Forward);
        Add(name + "/backward/" + what + who, {scene, color, alpha, workers}, Backward);
      }
    };
    all("both", true, true), all("color", true, false), all("alpha", false, true);
    const RunSpec perspective{scene, true, true, 1, Interpolation::kPerspective};
    Add(name + "/forward/perspective/1", perspective, Forward);
    Add(name + "/backward/perspective/1", perspective, Backward);
    AddNaive(scene);
  }
  return true;
}();

}  // namespace
}  // namespace tilegrad::bench
