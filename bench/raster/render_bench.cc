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

void Forward(benchmark::State& state, const SceneSpec& spec, const RenderRequest& request,
             int worker_count) {
  const BenchBatch batch(spec);
  const Workers workers(worker_count);
  Renderer renderer(workers);
  Frame frame;
  for (auto _ : state) Check(renderer.Render(batch.scenes, batch.options, request, &frame), state);
  CountImages(state, spec.images);
}

void Backward(benchmark::State& state, const SceneSpec& spec, int worker_count) {
  BenchBatch batch(spec);
  const Workers workers(worker_count);
  Renderer renderer(workers);
  Frame frame;
  Check(renderer.Render(batch.scenes, batch.options, {}, &frame), state);
  for (auto _ : state) {
    Check(renderer.Backward(batch.scenes, batch.options, frame, {batch.d_attributes, batch.d_alpha},
                            batch.d_scenes),
          state);
  }
  CountImages(state, spec.images);
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

const bool kRegistered = [] {
  for (const SceneSpec& spec : kScenes) {
    const std::string name = spec.name;
    const auto add = [&](const std::string& what, auto run) {
      benchmark::RegisterBenchmark((name + "/" + what).c_str(), run)
          ->Unit(benchmark::kMillisecond)
          ->MeasureProcessCPUTime()
          ->UseRealTime();
    };
    for (const int workers : {1, 2}) {
      const std::string suffix = workers == 1 ? "" : "/2_workers";
      add("forward" + suffix,
          [&spec, workers](benchmark::State& state) { Forward(state, spec, {}, workers); });
      add("forward_no_alpha" + suffix, [&spec, workers](benchmark::State& state) {
        Forward(state, spec, {true, false, false, false}, workers);
      });
      add("backward" + suffix,
          [&spec, workers](benchmark::State& state) { Backward(state, spec, workers); });
    }
    add("naive_forward", [&spec](benchmark::State& state) { NaiveForward(state, spec); });
    add("naive_backward", [&spec](benchmark::State& state) { NaiveBackward(state, spec); });
  }
  return true;
}();

}  // namespace
}  // namespace tilegrad::bench
