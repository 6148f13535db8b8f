// SPDX-License-Identifier: Apache-2.0
#include "raster/render_runs.h"

#include <benchmark/benchmark.h>

#include <map>
#include <tuple>

#include "raster/work_count.h"
#include "render/pipeline/pipeline.h"
#include "render/reference.h"

namespace tilegrad::bench {
namespace {

BenchBatch MakeBatch(const RunSpec& spec) {
  BenchBatch batch(spec.scene);
  batch.options.interpolation = spec.interpolation;
  batch.options.delta = spec.delta;
  batch.options.max_alpha_error = spec.max_alpha_error;
  return batch;
}

CulledParts PartsOf(const RunSpec& spec) { return {spec.color, spec.alpha}; }

Outputs RequestOf(const RunSpec& spec) {
  return {.color = false, .alpha = spec.alpha, .attributes = spec.color};
}

PipelineCotangents CotangentsOf(const RunSpec& spec, const BenchBatch& batch) {
  PipelineCotangents d_frame;
  if (spec.color) d_frame.attributes = batch.d_attributes;
  if (spec.alpha) d_frame.alpha = batch.d_alpha;
  return d_frame;
}

// Rows of the first image: across its middle, where half of the pixels are covered.
RowRange SampleRows(const SceneSpec& spec) {
  return {spec.size / 4, spec.size / 4 + (spec.level > 3 ? 1 : 2)};
}

double SampledShare(const SceneSpec& spec) {
  const RowRange rows = SampleRows(spec);
  return static_cast<double>(rows.end - rows.begin) / (spec.size * spec.images);
}

// Counting takes longer than rendering: once for each scene and kernel.
const WorkCount& WorkOf(const RunSpec& spec) {
  using Key = std::tuple<int, int, int, const Mesh*, double>;
  static std::map<Key, WorkCount> known;
  const SceneSpec& s = spec.scene;
  const auto [at, is_new] = known.try_emplace(Key{s.images, s.size, s.level, s.mesh, spec.delta});
  if (is_new) {
    CulledBatch culled(MakeBatch(spec));
    culled.Forward({true, false});
    for (std::size_t i = 0; i < culled.scenes.size(); ++i) {
      at->second += CountWork(culled.scenes[i], culled.frames[i]);
    }
  }
  return at->second;
}

void SetCounters(benchmark::State& state, const RunSpec& spec, Direction direction, double share) {
  const WorkCount& work = WorkOf(spec);
  const Limit limit = direction == Direction::kForward ? ForwardLimit(work, PartsOf(spec))
                                                       : BackwardLimit(work, PartsOf(spec));
  state.counters["images"] = spec.scene.images;
  state.counters["pixels"] = work.pixels;
  state.counters["faces"] = work.faces;
  if (spec.alpha && work.pairs > 0) {  // zeros have no variation: NaN is not JSON
    state.counters["pairs"] = state.counters["exps"] = work.pairs;
  }
  state.counters["bytes"] = limit.bytes;
  state.counters["limit_ms"] = limit.low;
  state.counters["limit_high_ms"] = limit.high;
  state.counters["share"] = share;
}

// What the last call of the renderer evaluated for alpha.
void SetEvaluated(benchmark::State& state, const RunSpec& spec, const Pipeline& renderer) {
  if (!spec.alpha) return;
  state.counters["evaluated_pairs"] = static_cast<double>(renderer.stats().pairs);
  state.counters["evaluated_exps"] = static_cast<double>(renderer.stats().powers);
}

void Forward(benchmark::State& state, const RunSpec& spec) {
  const BenchBatch batch = MakeBatch(spec);
  const Workers workers(spec.workers);
  Pipeline renderer(workers);
  FrameImages frame;
  const Outputs request = RequestOf(spec);
  // The first frame finds its memory: not what a steady state costs.
  Draw(batch, request, &renderer, &frame);
  for (auto _ : state) Draw(batch, request, &renderer, &frame);
  SetEvaluated(state, spec, renderer);
}

void Backward(benchmark::State& state, const RunSpec& spec) {
  BenchBatch batch = MakeBatch(spec);
  const Workers workers(spec.workers);
  Pipeline renderer(workers);
  FrameImages frame;
  Draw(batch, {.color = false}, &renderer, &frame);
  const PipelineCotangents d_frame = CotangentsOf(spec, batch);
  const auto backward = [&] {
    if (renderer.Backward(batch.views, batch.options, frame, d_frame, batch.d_scenes)) return;
    state.SkipWithError("a gradient is not finite");
  };
  backward();
  for (auto _ : state) backward();
  SetEvaluated(state, spec, renderer);
}

void CulledForwardRun(benchmark::State& state, const RunSpec& spec) {
  CulledBatch culled(MakeBatch(spec));
  culled.Forward(PartsOf(spec));
  for (auto _ : state) culled.Forward(PartsOf(spec));
}

void CulledBackwardRun(benchmark::State& state, const RunSpec& spec) {
  CulledBatch culled(MakeBatch(spec));
  culled.Forward({});
  culled.Backward(PartsOf(spec));
  for (auto _ : state) culled.Backward(PartsOf(spec));
}

void NaiveForward(benchmark::State& state, const RunSpec& spec) {
  const BenchBatch batch = MakeBatch(spec);
  const RowRange rows = SampleRows(spec.scene);
  const Scene& scene = batch.scenes[0];
  const Outputs request = RequestOf(spec);
  FrameImages frame;
  for (auto _ : state) {
    const auto ids = FaceIdsRef(scene, batch.options, rows);
    ReferenceRender(scene, batch.options, request, ids, &frame, rows);
  }
}

void NaiveBackward(benchmark::State& state, const RunSpec& spec) {
  BenchBatch batch = MakeBatch(spec);
  const RowRange rows = SampleRows(spec.scene);
  const Scene& scene = batch.scenes[0];
  const auto ids = FaceIdsRef(scene, batch.options, rows);
  const PipelineCotangents d_images = CotangentsOf(spec, batch);
  const FrameGradients d_frame{.alpha = d_images.alpha, .attributes = d_images.attributes};
  SceneGradients d_scene{.positions = batch.d_positions[0]};
  d_scene.attributes = batch.d_colors[0];
  for (auto _ : state) {
    ReferenceRenderBackward(scene, batch.options, ids, d_frame, d_scene, rows);
  }
}

using Run = void (*)(benchmark::State&, const RunSpec&);

Run RunOf(Who who, Direction direction) {
  const bool forward = direction == Direction::kForward;
  switch (who) {
    case Who::kRenderer:
      return forward ? Forward : Backward;
    case Who::kCulled:
      return forward ? CulledForwardRun : CulledBackwardRun;
    case Who::kNaive:
      break;
  }
  return forward ? NaiveForward : NaiveBackward;
}

}  // namespace

void AddRun(const RunName& name, const RunSpec& spec, Who who) {
  for (const Direction direction : {Direction::kForward, Direction::kBackward}) {
    const char* way = direction == Direction::kForward ? "/forward/" : "/backward/";
    const std::string full = name.scene + way + name.what + "/" + name.who;
    const auto run = [=](benchmark::State& state) {
      RunOf(who, direction)(state, spec);
      SetCounters(state, spec, direction, who == Who::kNaive ? SampledShare(spec.scene) : 1);
    };
    benchmark::RegisterBenchmark(full.c_str(), run)
        ->Unit(benchmark::kMillisecond)
        ->MeasureProcessCPUTime()
        ->UseRealTime();
  }
}

}  // namespace tilegrad::bench
