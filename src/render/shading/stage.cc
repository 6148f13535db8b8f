// SPDX-License-Identifier: Apache-2.0
#include "render/shading/stage.h"

#include <algorithm>

#include "base/array_checks.h"
#include "base/clocks.h"
#include "raster/conventions.h"
#include "render/pipeline/stages.h"

namespace tilegrad {
namespace {

using shade::RunPlane;

// The foreground pixels of `rows` (kBinSize wide), in order, grouped by surface. `face_surfaces`
// [F] of `source_face` [mesh faces], or empty: all 0.
void FindSegments(const raster::FaceRows& rows, int columns,
                  std::span<const std::int32_t> source_face,
                  std::span<const std::int32_t> face_surfaces,
                  std::vector<PixelSegment>* segments) {
  segments->clear();
  const auto surface_of = [&](std::int32_t face) -> std::int32_t {
    if (face_surfaces.empty()) return 0;
    return face_surfaces[static_cast<std::size_t>(source_face[static_cast<std::size_t>(face)])];
  };
  for (int i = rows.row_begin; i < rows.row_end; ++i) {
    const std::int32_t* const faces = rows.row(i);
    const std::int32_t at = (i - rows.row_begin) * raster::kBinSize;
    for (std::int32_t j = 0; j < columns;) {
      if (faces[j] == raster::kNoFace) {
        ++j;
        continue;
      }
      const std::int32_t first = j, face = faces[j], surface = surface_of(face);
      const auto same_surface = [&](std::int32_t other) {
        return other == face || (other != raster::kNoFace && surface_of(other) == surface);
      };
      while (j < columns && same_surface(faces[j])) ++j;
      segments->push_back({surface, at + first, j - first});
    }
  }
  if (face_surfaces.empty()) return;
  std::sort(segments->begin(), segments->end(), [](const auto& a, const auto& b) {
    return a.surface != b.surface ? a.surface < b.surface : a.at < b.at;
  });
}

// Calls visit(run, worker) for the runs of a strip's foreground, and counts their pixels.
template <class Visit>
void ForRunsOf(const PixelStrip& strip, const StageScene& scene, StageWorker* worker,
               const Visit& visit) {
  FindSegments(strip.rows, strip.columns, strip.mesh->source_face, scene.scene->face_surfaces,
               &worker->segments);
  const std::span<const PixelSegment> segments = worker->segments;
  for (std::size_t i = 0; i < segments.size();) {
    std::size_t end = i, count = 0;
    while (end < segments.size() && segments[end].surface == segments[i].surface &&
           count + static_cast<std::size_t>(segments[end].count) <= shade::kRunPixels) {
      count += static_cast<std::size_t>(segments[end++].count);
    }
    worker->work.pixels += static_cast<std::int64_t>(count);
    visit(PixelRun{segments.subspan(i, end - i), count}, worker);
    i = end;
  }
}

// Calls visit(place in the run, pixel of the strip) for each pixel of a run.
template <class Visit>
void ForEachRunPixel(const PixelRun& run, const Visit& visit) {
  std::size_t to = 0;
  for (const PixelSegment& s : run.segments) {
    for (std::int32_t i = 0; i < s.count; ++i) visit(to++, s.at + i);
  }
}

// Offsets of a strip's pixels in a plane of an image: rows of `row` floats.
struct StripRows {
  std::ptrdiff_t row;
  std::ptrdiff_t operator()(std::int32_t at) const {  // of a pixel of the strip
    return static_cast<std::ptrdiff_t>(at >> raster::kBinBits) * row +
           (at & (raster::kBinSize - 1));
  }
};

std::size_t PaddedEnd(std::size_t count) {
  return (count + shade::kRunPad - 1) / shade::kRunPad * shade::kRunPad;
}

// Fills the last vector of `count` values.
void PadRun(std::size_t count, float value, RunPlane* p) {
  std::fill(p->at + count, p->at + PaddedEnd(count), value);
}

// The same with the last of the values.
void PadRun(std::size_t count, RunPlane* p) { PadRun(count, p->at[count - 1], p); }

void GatherPixels(const PixelRun& run, const float* plane, const StripRows& rows, float* to) {
  for (const PixelSegment& s : run.segments) {
    const float* const from = plane + rows(s.at);
    to = std::copy(from, from + s.count, to);
  }
}

// to <- the run's pixels of `plane`, whose first is the strip's first pixel; copies of the last one
// fill the last vector.
void GatherRun(const PixelRun& run, const float* plane, const StripRows& rows, RunPlane* to) {
  GatherPixels(run, plane, rows, to->at);
  PadRun(run.count, to);
}

// The same; 0 fills the last vector.
void GatherCotangents(const PixelRun& run, const float* plane, const StripRows& rows,
                      RunPlane* to) {
  GatherPixels(run, plane, rows, to->at);
  PadRun(run.count, 0.0f, to);
}

void ScatterRun(const PixelRun& run, const RunPlane& from, const StripRows& rows, float* plane) {
  const float* next = from.at;
  for (const PixelSegment& s : run.segments) {
    std::copy(next, next + s.count, plane + rows(s.at));
    next += s.count;
  }
}

// Channels [0, n) of `from` to the planes of `to`.
void GatherChannels(const PixelRun& run, const PixelStrip& strip, int first,
                    std::span<RunPlane> to) {
  for (std::size_t c = 0; c < to.size(); ++c) {
    const std::size_t channel = static_cast<std::size_t>(first) + c;
    GatherRun(run, strip.varyings + channel * strip.plane(), {raster::kBinSize}, &to[c]);
  }
}

// The planes of an image of `planes` planes, from a strip's first pixel on.
template <class T>
T* PlaneOf(T* batch, std::size_t planes, std::size_t c, std::size_t pixels,
           const PixelStrip& strip) {
  return batch + (strip.image * planes + c) * pixels + strip.first;
}

// Counter-clockwise in space is clockwise here, where y goes down. In double: for faces that reach
// far out of the image float cannot decide the sign.
bool SeenFromFront(const raster::ScreenMesh& mesh, std::size_t f) {
  const raster::ScreenCorners<double> c = raster::Wide(raster::CornersOf(mesh, f));
  return (c.x[1] - c.x[0]) * (c.y[2] - c.y[0]) - (c.x[2] - c.x[0]) * (c.y[1] - c.y[0]) <= 0;
}

// Calls visit(place in the run, pixel of the strip, its face); new_face: not that of the last call.
template <class Visit>
void ForEachFacePixel(const PixelStrip& strip, const PixelRun& run, const Visit& visit) {
  std::int32_t last = raster::kNoFace;
  ForEachRunPixel(run, [&](std::size_t to, std::int32_t at) {
    const std::int32_t face = strip.rows.faces[at];
    visit(to, at, static_cast<std::size_t>(face), face != last);
    last = face;
  });
}

void SetSides(const PixelStrip& strip, const PixelRun& run, RunPlane* side) {
  float value = 1;
  ForEachFacePixel(strip, run, [&](std::size_t to, std::int32_t, std::size_t face, bool fresh) {
    if (fresh) value = SeenFromFront(*strip.mesh, face) ? 1.0f : -1.0f;
    side->at[to] = value;
  });
  PadRun(run.count, side);
}

void SetLevels(const PixelStrip& strip, const PixelRun& run, int first_uv, Interpolation mode,
               const shade::TextureView& texture, RunValues* v) {
  UvPlanes planes;
  const int size[2] = {texture.width, texture.height};
  ForEachFacePixel(strip, run, [&](std::size_t to, std::int32_t at, std::size_t face, bool fresh) {
    if (fresh) planes = UvPlanesOf(*strip.mesh, strip.attributes, first_uv, face, mode);
    const int x = strip.rows.x0 + (at & (raster::kBinSize - 1));
    const int y = strip.rows.row_begin + (at >> raster::kBinBits);
    const double uv[2] = {v->uv[0].at[to], v->uv[1].at[to]};
    v->level.at[to] = UvLevel<float>(planes, x + 0.5, y + 0.5, uv, size);
  });
  PadRun(run.count, &v->level);
}

void ClearRows(const PixelStrip& strip, std::size_t width, float* plane) {
  for (int i = strip.rows.row_begin; i < strip.rows.row_end; ++i, plane += width) {
    std::fill_n(plane, strip.columns, 0.0f);
  }
}

}  // namespace

ShadeStage::ShadeStage(std::size_t workers) {
  for (std::size_t i = 0; i < workers; ++i) workers_.push_back(std::make_unique<StageWorker>());
}

void ShadeStage::Begin(std::span<const StageScene> scenes, const RenderOptions& options) {
  scenes_ = scenes;
  options_ = &options;
  pixels_ = static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height);
  for (auto& worker : workers_) worker->work = {};
  sound_ = true;
}

void ShadeStage::BeginForward(const ForwardPlan& plan, std::span<const StageScene> scenes,
                              const RenderOptions& options, FrameImages* frame) {
  forward_ = &plan;
  frame_ = frame;
  Begin(scenes, options);
}

void ShadeStage::BeginBackward(const BackwardPlan& plan, std::span<const StageScene> scenes,
                               const RenderOptions& options, const FrameGradients& d_frame) {
  backward_ = &plan;
  d_frame_ = &d_frame;
  Begin(scenes, options);
  bands_of_image_ = BandGrid(options.width, options.height).count();
  if (bands_.size() < scenes.size() * bands_of_image_) {
    bands_.resize(scenes.size() * bands_of_image_);
  }
}

ShadeWork ShadeStage::work() const {
  ShadeWork sum;
  for (const auto& worker : workers_) sum.Add(worker->work);
  return sum;
}

RunScene ShadeStage::RunSceneOf(const StageScene& scene, std::int32_t surface) const {
  const Surface& s = scene.surfaces[static_cast<std::size_t>(surface)];
  const auto texture = static_cast<std::size_t>(s.texture);
  return {.shading = &scene.scene->shading,
          .surface = &s,
          .lights = scene.lights,
          .sh = &scene.sh,
          .texture = s.texture < 0 || scene.textures.empty() ? nullptr : scene.textures[texture],
          .eye = scene.eye};
}

void ShadeStage::GatherInputs(const PixelStrip& strip, const PixelRun& run, const VaryingSet& set,
                              const ShadeSteps& steps, StageWorker* worker) const {
  RunValues* const v = &worker->values;
  ForEachVarying(*v, [&](Varying what, std::span<RunPlane> to) {
    if (set[what]) GatherChannels(run, strip, set.first(what), to);
  });
  const StageScene& scene = scenes_[strip.image];
  if (steps.turn) SetSides(strip, run, &v->side);
  if (!steps.level) return;
  const RunScene run_scene = RunSceneOf(scene, run.surface());
  if (run_scene.texture == nullptr) return;
  SetLevels(strip, run, set.first(Varying::kUv), options_->interpolation, run_scene.texture->view(),
            v);
}

void ShadeStage::ForwardRun(const PixelStrip& strip, const PixelRun& run, StageWorker* worker) {
  const ForwardPlan& plan = *forward_;
  const RunScene scene = RunSceneOf(scenes_[strip.image], run.surface());
  RunValues* const v = &worker->values;
  ShadeWork* const work = &worker->work;
  StageClock clock;
  GatherInputs(strip, run, plan.varyings, plan.steps, worker);
  clock.Lap(&work->gather);
  ShadeRun(run.count, plan.steps, scene, v, work);
  clock = {};
  const StripRows rows{frame_->width};
  const auto scatter = [&](AlignedVector<float>& images, std::span<const RunPlane> from) {
    for (std::size_t c = 0; c < from.size(); ++c) {
      ScatterRun(run, from[c], rows, PlaneOf(images.data(), from.size(), c, pixels_, strip));
    }
  };
  if (plan.steps.color) {
    ColorRun(run.count, plan, scene, v);
    clock.Lap(&work->color);
    scatter(frame_->color, v->color);
  }
  if (plan.request.normals) scatter(frame_->normals, v->unit);
  if (plan.request.uv && plan.parts[Varying::kUv]) scatter(frame_->uv, v->uv);
  const auto user = static_cast<std::size_t>(plan.varyings.width(Varying::kUser));
  const auto first = static_cast<std::size_t>(plan.varyings.first(Varying::kUser));
  for (std::size_t c = 0; c < user; ++c) {
    RunPlane plane;
    GatherRun(run, strip.varyings + (first + c) * strip.plane(), {raster::kBinSize}, &plane);
    ScatterRun(run, plane, rows, PlaneOf(frame_->attributes.data(), user, c, pixels_, strip));
  }
  clock.Lap(&work->scatter);
}

void ShadeStage::Forward(const PixelStrip& strip) {
  const auto width = static_cast<std::size_t>(frame_->width);
  const auto clear = [&](AlignedVector<float>& images) {
    const std::size_t planes = images.size() / frame_->face_ids.size();
    for (std::size_t c = 0; c < planes; ++c) {
      ClearRows(strip, width, PlaneOf(images.data(), planes, c, pixels_, strip));
    }
  };
  clear(frame_->color);
  clear(frame_->normals);
  clear(frame_->uv);
  clear(frame_->attributes);
  if (!strip.any_face) return;
  ForRunsOf(strip, scenes_[strip.image], workers_[strip.worker].get(),
            [&](const PixelRun& run, StageWorker* worker) { ForwardRun(strip, run, worker); });
}

bool ShadeStage::BeginBand(std::size_t image, std::size_t band, std::size_t first,
                           std::size_t pixels) {
  const StageScene& scene = scenes_[image];
  StageBand& out = bands_[image * bands_of_image_ + band];
  out.sums.Clear(scene.surfaces.size(), scene.lights.size());
  out.shares.resize(scene.textures.size());
  for (auto& shares : out.shares) shares.clear();
  const auto sound = [&](std::span<const float> images, std::size_t planes) {
    for (std::size_t c = 0; c < planes && !images.empty(); ++c) {
      if (!AllFinite(images.subspan((image * planes + c) * pixels_ + first, pixels))) return false;
    }
    return true;
  };
  const auto channels = static_cast<std::size_t>(scene.scene->channels);
  if (sound(d_frame_->color, 3) && sound(d_frame_->normals, 3) && sound(d_frame_->uv, 2) &&
      sound(d_frame_->attributes, channels)) {
    return true;
  }
  sound_ = false;
  return false;
}

void ShadeStage::GatherCotangentsOf(const PixelStrip& strip, const PixelRun& run,
                                    RunCotangents* d) const {
  const auto gather = [&](std::span<const float> images, std::span<RunPlane> to) {
    for (std::size_t c = 0; c < to.size(); ++c) {
      GatherCotangents(run, PlaneOf(images.data(), to.size(), c, pixels_, strip), {options_->width},
                       &to[c]);
    }
  };
  if (backward_->wishes.d_color) gather(d_frame_->color, d->color);
  if (backward_->wishes.d_normals) gather(d_frame_->normals, d->unit);
}

// depth = -(z . p + t_z), z the third row of the rotation. Background pixels, whose depth is
// infinite, are skipped: their cotangent is often NaN.
void ShadeStage::DepthAdjoint(const PixelStrip& strip, const PixelRun& run, StageWorker* worker,
                              SceneSums* sums) {
  const Camera& camera = scenes_[strip.image].scene->camera;
  RunPlane d_depth;
  GatherCotangents(run, PlaneOf(d_frame_->depth.data(), 1, 0, pixels_, strip), {options_->width},
                   &d_depth);
  if (!AllFinite(std::span<const float>(d_depth.at, run.count))) sound_ = false;
  if (!backward_->geometry) return;
  const bool position = backward_->recomputed[Varying::kPosition];
  for (std::size_t i = 0; i < run.count; ++i) {
    const float d = d_depth.at[i];
    sums->depth_shift -= static_cast<double>(d);
    for (std::size_t c = 0; c < 3; ++c) {
      worker->d.position[c].at[i] -= camera.rotation[6 + c] * d;
      if (!position) continue;
      sums->depth_axis[c] -= static_cast<double>(d) * worker->values.position[c].at[i];
    }
  }
}

void ShadeStage::ScatterCotangents(const PixelStrip& strip, const PixelRun& run,
                                   const raster::PlanarView<float>& d_varyings,
                                   const RunCotangents& d) const {
  const StripRows rows{d_varyings.row};
  const VaryingSet& set = backward_->pulled;
  ForEachVarying(d, [&](Varying what, std::span<const RunPlane> from) {
    if (!set[what]) return;
    for (std::size_t c = 0; c < from.size(); ++c) {
      const std::ptrdiff_t plane = set.first(what) + static_cast<std::ptrdiff_t>(c);
      ScatterRun(run, from[c], rows, d_varyings.data + plane * d_varyings.plane);
    }
  });
  const auto user = static_cast<std::size_t>(set.width(Varying::kUser));
  for (std::size_t c = 0; c < user; ++c) {
    RunPlane plane;
    GatherCotangents(run, PlaneOf(d_frame_->attributes.data(), user, c, pixels_, strip),
                     {options_->width}, &plane);
    const std::ptrdiff_t to = set.first(Varying::kUser) + static_cast<std::ptrdiff_t>(c);
    ScatterRun(run, plane, rows, d_varyings.data + to * d_varyings.plane);
  }
}

// Adds the cotangent of the uv image.
void ShadeStage::AddUvCotangents(const PixelStrip& strip, const PixelRun& run,
                                 RunCotangents* d) const {
  for (std::size_t c = 0; c < 2; ++c) {
    RunPlane plane;
    GatherCotangents(run, PlaneOf(d_frame_->uv.data(), 2, c, pixels_, strip), {options_->width},
                     &plane);
    for (std::size_t i = 0; i < run.count; ++i) {
      d->uv[c].at[i] = plane.at[i] + (backward_->to_uv ? d->uv[c].at[i] : 0.0f);
    }
  }
}

// Allocates the shares of a run's lookups; null if the texture has no gradient.
shade::TexelShare* ShadeStage::NewShares(const RunScene& scene, std::size_t count,
                                         StageBand* band) const {
  if (!backward_->to_texture || scene.texture == nullptr) return nullptr;
  auto& shares = band->shares[static_cast<std::size_t>(scene.surface->texture)];
  const std::size_t had = shares.size();
  shares.resize(had + count * shade::SharesPerLookup(scene.texture->view().filter));
  return shares.data() + had;
}

void ShadeStage::BackwardRun(const PixelStrip& strip, const PixelRun& run,
                             const raster::PlanarView<float>& d_varyings, StageWorker* worker) {
  const BackwardPlan& plan = *backward_;
  StageBand& band = bands_[strip.image * bands_of_image_ + strip.band];
  const RunScene scene = RunSceneOf(scenes_[strip.image], run.surface());
  RunCotangents* const d = &worker->d;
  ShadeWork* const work = &worker->work;
  StageClock clock;
  GatherInputs(strip, run, plan.recomputed, plan.steps, worker);
  GatherCotangentsOf(strip, run, d);
  clock.Lap(&work->gather);
  ShadeRun(run.count, plan.steps, scene, &worker->values, work);
  clock = {};
  ShadeRunAdjoint(run.count, plan, scene, worker->values,
                  {d, &band.sums.surfaces[static_cast<std::size_t>(run.surface())], &band.sums,
                   NewShares(scene, run.count, &band)});
  if (plan.wishes.d_uv && plan.pulled[Varying::kUv]) AddUvCotangents(strip, run, d);
  if (plan.wishes.d_depth) DepthAdjoint(strip, run, worker, &band.sums);
  clock.Lap(&work->adjoint);
  ScatterCotangents(strip, run, d_varyings, *d);
  clock.Lap(&work->scatter);
}

void ShadeStage::Backward(const PixelStrip& strip, const raster::PlanarView<float>& d_varyings) {
  ForRunsOf(strip, scenes_[strip.image], workers_[strip.worker].get(),
            [&](const PixelRun& run, StageWorker* worker) {
              BackwardRun(strip, run, d_varyings, worker);
            });
}

}  // namespace tilegrad
