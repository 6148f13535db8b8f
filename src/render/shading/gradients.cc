// SPDX-License-Identifier: Apache-2.0
#include "render/shading/gradients.h"

#include <algorithm>

#include "render/shading/pack.h"

namespace tilegrad {
std::span<PipelineGradients> ShadeGradients::Begin(const BackwardPlan& plan,
                                                   std::span<const PipelineScene> views,
                                                   std::span<const SceneGradients> d_scenes) {
  d_views_.clear();
  if (scratch_.size() < views.size()) scratch_.resize(views.size());
  const bool attributes = plan.pulled.channels() > 0;
  for (std::size_t n = 0; n < views.size(); ++n) {
    SceneScratch& s = scratch_[n];
    s.d_positions.resize(d_scenes[n].positions.size());
    s.d_varyings.resize(attributes ? views[n].attributes.values.size() : 0);
    d_views_.push_back({s.d_positions, s.d_varyings, d_scenes[n].camera != nullptr, {}});
  }
  return d_views_;
}

void ShadeGradients::Merge(const BackwardPlan& plan, const ShadeInputs& inputs,
                           std::span<const Scene> scenes,
                           std::span<const SceneGradients> d_scenes) {
  const Batch batch{plan, inputs, scenes, d_scenes};
  if (plan.staged()) {
    workers_->For(scenes.size(), [&](std::size_t n, std::size_t) { AddToPositions(batch, n); });
  }
  FindTargets(d_scenes);
  workers_->For(sinks_.size(), [&](std::size_t i, std::size_t) { FillSink(batch, sinks_[i]); });
}

// Positions that were interpolated, and normals derived from positions.
void ShadeGradients::AddToPositions(const Batch& batch, std::size_t scene) {
  SceneScratch& s = scratch_[scene];
  if (s.d_positions.empty()) return;
  const VaryingSet& set = batch.plan.pulled;
  if (set[Varying::kPosition]) {
    AddStream(batch.scenes[scene], set, Varying::kPosition, s.d_varyings, s.d_positions);
  }
  if (!set[Varying::kNormal] || batch.plan.parts.shading.normals == Normals::kGiven) return;
  const SceneNormals& normals = batch.inputs.normals(scene);
  if (normals.empty()) return;  // of no faces
  s.d_units.assign(normals.size(), {0, 0, 0});
  AddStream(batch.scenes[scene], set, Varying::kNormal, s.d_varyings,
            {s.d_units[0].data(), 3 * s.d_units.size()});
  AddNormalsAdjoint(batch.scenes[scene], normals, s.d_units, s.d_positions);
}

void ShadeGradients::FindTargets(std::span<const SceneGradients> d_scenes) {
  targets_.clear();
  sinks_.clear();
  for (std::size_t n = 0; n < d_scenes.size(); ++n) {
    ForEachStream(Scene(), d_scenes[n], [&](const SceneStream<float>& stream) {
      const std::span<float> out = stream.gradient;
      if (out.empty()) return;
      targets_.push_back({out, stream.what, n});
      const bool known = std::any_of(sinks_.begin(), sinks_.end(),
                                     [&](const Target& s) { return s.out.data() == out.data(); });
      if (!known) sinks_.push_back(targets_.back());
    });
  }
}

void ShadeGradients::FillSink(const Batch& batch, const Target& sink) const {
  std::fill(sink.out.begin(), sink.out.end(), 0.0f);
  // Normals of positions are pulled; those that the scene has besides are not used.
  const bool unused =
      sink.what == Varying::kNormal && batch.plan.parts.shading.normals != Normals::kGiven;
  const bool position = sink.what == Varying::kPosition;
  if (unused || (!position && !batch.plan.pulled[sink.what])) return;
  for (const Target& target : targets_) {
    if (target.out.data() != sink.out.data()) continue;
    const SceneScratch& s = scratch_[target.scene];
    if (position) {
      for (std::size_t i = 0; i < sink.out.size(); ++i) sink.out[i] += s.d_positions[i];
    } else {
      AddStream(batch.scenes[target.scene], batch.plan.pulled, sink.what, s.d_varyings, sink.out);
    }
  }
}

}  // namespace tilegrad
