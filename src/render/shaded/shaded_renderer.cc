// SPDX-License-Identifier: Apache-2.0
#include "render/shaded/shaded_renderer.h"

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "base/stage_clock.h"
#include "render/shaded/shade_merge.h"
#include "render/shaded/shade_pack.h"
#include "render/shaded/shade_report.h"
#include "render/shaded/shade_stage.h"
#include "render/shaded/shade_validate.h"
#include "render/validate.h"
#include "shade/normalize_ref.h"
#include "shade/spherical_harmonics_ref.h"

namespace tilegrad {
namespace {

// The arrays of a scene that are packed. Scenes with the same ones share what is packed.
bool SameSources(const ShadedScene& a, const ShadedScene& b) {
  const auto same = [](auto x, auto y) { return x.data() == y.data() && x.size() == y.size(); };
  return same(a.positions, b.positions) && same(a.faces, b.faces) &&
         same(a.attributes, b.attributes) && same(a.colors.values, b.colors.values) &&
         same(a.uvs.values, b.uvs.values) && same(a.normals.values, b.normals.values) &&
         same(a.light_directions, b.light_directions);
}

// What is packed of a scene, or of several that share their arrays.
struct ScenePack {
  SceneNormals normals;
  AlignedVector<float> varyings;    // forward, or pulled
  AlignedVector<float> recomputed;  // where it is not the same
};

// Gradients of one scene before they are merged.
struct SceneScratch {
  AlignedVector<float> d_varyings, d_positions;
  AlignedVector<shade::Vec3<float>> d_units;
};

void SetLights(const ShadedScene& scene, StageScene* out) {
  out->lights.assign(scene.lights.begin(), scene.lights.end());
  out->inverse_lengths.clear();
  for (auto& light : out->lights) {
    const auto unit = shade::NormalizeScaledRef(light.direction);
    light.direction = unit.unit;
    out->inverse_lengths.push_back(unit.inverse_length);
  }
  if (scene.model.lighting != Lighting::kSphericalHarmonics) return;
  out->sh = shade::ShPolynomialOf<float>(scene.model.sh_basis, scene.sh);
}

void SetSurfaces(const ShadedScene& scene, StageScene* out) {
  out->surfaces.assign(scene.surfaces.begin(), scene.surfaces.end());
  if (!out->surfaces.empty()) return;
  Surface surface;
  surface.texture = scene.textures.empty() ? -1 : 0;
  out->surfaces.push_back(surface);
}

shade::Vec3<float> EyeOf(const Camera& camera) {  // -R^T t
  shade::Vec3<float> eye = {};
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 3; ++c)
      eye[c] -= camera.rotation[3 * r + c] * camera.translation[r];
  }
  return eye;
}

bool SameTexture(const shade::TextureView& a, const shade::TextureView& b) {
  return a.texels.data() == b.texels.data() && a.width == b.width && a.height == b.height &&
         a.wrap == b.wrap && a.filter == b.filter;
}

// The array of a gradient that a stream of a scene goes to.
std::span<float> TargetOf(const ShadedGradients& d, Varying what) {
  switch (what) {
    case Varying::kColor:
      return d.colors;
    case Varying::kUv:
      return d.uvs;
    case Varying::kNormal:
      return d.normals;
    case Varying::kLightDirection:
      return d.light_directions;
    case Varying::kUser:
      return d.attributes;
    default:
      return {};
  }
}

GradientWishes WishesOf(const ShadedFrameGradients& d_frame,
                        std::span<const ShadedGradients> d_scenes) {
  GradientWishes w;
  w.d_color = !d_frame.color.empty(), w.d_normals = !d_frame.normals.empty();
  w.d_uv = !d_frame.uv.empty(), w.d_depth = !d_frame.depth.empty();
  w.d_user = !d_frame.attributes.empty(), w.d_alpha = !d_frame.alpha.empty();
  for (const ShadedGradients& d : d_scenes) {
    w.positions |= !d.positions.empty(), w.camera |= d.camera;
    w.colors |= !d.colors.empty(), w.uvs |= !d.uvs.empty(), w.normals |= !d.normals.empty();
    w.light_directions |= !d.light_directions.empty(), w.user |= !d.attributes.empty();
    w.surfaces |= !d.surfaces.empty(), w.lights |= !d.lights.empty(), w.sh |= !d.sh.empty();
    for (const auto& texture : d.textures) w.textures |= !texture.empty();
  }
  return w;
}

// One array of the caller; scenes may share it.
struct Sink {
  std::span<float> out;
  Varying what;  // kPosition: positions
};

}  // namespace

struct ShadedRenderer::Impl {
  explicit Impl(const Workers& w)
      : workers(&w), renderer(w), stage(static_cast<std::size_t>(w.count())) {}

  void PrepareScenes(std::span<const ShadedScene> scenes, bool textures);
  void PrepareTextures(std::span<const ShadedScene> scenes);
  void FindPacks(std::span<const ShadedScene> scenes);
  void Pack(std::span<const ShadedScene> scenes, bool normals, const VaryingSet& set,
            const VaryingSet* recomputed);
  void UsePlain(std::span<const ShadedScene> scenes, bool colors, bool user);
  void SetViews(std::span<const ShadedScene> scenes);

  Status RenderStaged(const RenderOptions& options, ShadedFrame* frame);
  Status RenderPlain(const RenderOptions& options, ShadedFrame* frame);
  Status Render(std::span<const ShadedScene> scenes, const RenderOptions& options,
                const ShadedRequest& request, ShadedFrame* frame);

  void SetGradients(std::span<const ShadedScene> scenes, std::span<ShadedGradients> d_scenes);
  void NormalsBack(std::span<const ShadedScene> scenes);
  void FindSinks(std::span<ShadedGradients> d_scenes);
  void FillSink(std::span<const ShadedScene> scenes, std::span<ShadedGradients> d_scenes,
                const Sink& sink);
  // The renderer's own backward pass, with the stage if there is one.
  Status RunBackward(const RenderOptions& options, const ShadedFrame& frame,
                     const ShadedFrameGradients& d_frame);
  // From what that pass has summed to gradients of the scenes' arrays.
  void MergeBackward(std::span<const ShadedScene> scenes, std::span<ShadedGradients> d_scenes);
  Status Backward(std::span<const ShadedScene> scenes, const RenderOptions& options,
                  const ShadedFrame& frame, const ShadedFrameGradients& d_frame,
                  std::span<ShadedGradients> d_scenes);

  PlanReport Explain() const;

  const Workers* workers;
  Renderer renderer;
  ShadeStage stage;
  bool staged = false, was_backward = false;  // of the last call
  SceneWork work;
  ForwardPlan forward;
  BackwardPlan backward;
  std::vector<StageScene> stage_scenes;
  std::vector<SceneView> views;
  std::vector<ScenePack> packs;
  std::vector<std::size_t> pack_of_scene, first_of_pack;
  std::vector<std::unique_ptr<shade::TexturePyramid>> pyramids;
  std::vector<shade::TextureView> pyramid_views;
  std::vector<SceneScratch> scratch;
  std::vector<SceneGradients> d_views;
  std::vector<Sink> sinks;
  TextureMerge texture_merge;
  SceneSums scene_sums;
};

void ShadedRenderer::Impl::PrepareTextures(std::span<const ShadedScene> scenes) {
  pyramid_views.clear();
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    for (const shade::TextureView& view : scenes[n].textures) {
      std::size_t i = 0;
      while (i < pyramid_views.size() && !SameTexture(pyramid_views[i], view)) ++i;
      if (i == pyramid_views.size()) pyramid_views.push_back(view);
      if (i == pyramids.size()) pyramids.push_back(std::make_unique<shade::TexturePyramid>());
      stage_scenes[n].textures.push_back(pyramids[i].get());
    }
  }
  StageClock clock;
  workers->For(pyramid_views.size(),
               [&](std::size_t i, std::size_t) { pyramids[i]->Build(pyramid_views[i]); });
  clock.Lap(&work.textures_ms);
  for (std::size_t i = 0; i < pyramid_views.size(); ++i) {
    const shade::LevelSize& last = pyramids[i]->sizes().back();
    work.texels += static_cast<std::int64_t>(last.first + last.texels());
  }
}

void ShadedRenderer::Impl::PrepareScenes(std::span<const ShadedScene> scenes, bool textures) {
  stage_scenes.resize(scenes.size());
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    StageScene& out = stage_scenes[n];
    out.scene = &scenes[n];
    SetSurfaces(scenes[n], &out), SetLights(scenes[n], &out);
    out.eye = EyeOf(scenes[n].camera);
    out.textures.clear();
  }
  if (textures) PrepareTextures(scenes);
}

void ShadedRenderer::Impl::FindPacks(std::span<const ShadedScene> scenes) {
  first_of_pack.clear(), pack_of_scene.clear();
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    if (n == 0 || !SameSources(scenes[n - 1], scenes[n])) first_of_pack.push_back(n);
    pack_of_scene.push_back(first_of_pack.size() - 1);
  }
  if (packs.size() < first_of_pack.size()) packs.resize(first_of_pack.size());
}

void ShadedRenderer::Impl::Pack(std::span<const ShadedScene> scenes, bool normals,
                                const VaryingSet& set, const VaryingSet* recomputed) {
  FindPacks(scenes);
  StageClock clock;
  if (normals && scenes[0].model.normals != NormalKind::kGiven) {
    workers->For(first_of_pack.size(), [&](std::size_t i, std::size_t) {
      DeriveNormals(scenes[first_of_pack[i]], &packs[i].normals);
    });
    for (const std::size_t n : first_of_pack) {
      work.normals += static_cast<std::int64_t>(scenes[n].faces.size() / 3);
    }
    clock.Lap(&work.normals_ms);
  }
  workers->For(first_of_pack.size(), [&](std::size_t i, std::size_t) {
    ScenePack& pack = packs[i];
    const ShadedScene& scene = scenes[first_of_pack[i]];
    PackVaryings(scene, set, pack.normals, &pack.varyings);
    if (recomputed != nullptr) PackVaryings(scene, *recomputed, pack.normals, &pack.recomputed);
  });
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    const ScenePack& pack = packs[pack_of_scene[n]];
    StageScene& out = stage_scenes[n];
    out.varyings = {pack.varyings, set.channels(), set.rate};
    out.recomputed = out.varyings;
    if (recomputed != nullptr) {
      out.recomputed = {pack.recomputed, recomputed->channels(), recomputed->rate};
    }
  }
  for (std::size_t i = 0; i < first_of_pack.size(); ++i) {
    work.packed += static_cast<std::int64_t>(packs[i].varyings.size());
    if (recomputed != nullptr) work.packed += static_cast<std::int64_t>(packs[i].recomputed.size());
  }
  clock.Lap(&work.pack_ms);
}

// Streams as they are.
void ShadedRenderer::Impl::UsePlain(std::span<const ShadedScene> scenes, bool colors, bool user) {
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    const ShadedScene& s = scenes[n];
    stage_scenes[n].varyings = {};
    if (colors) stage_scenes[n].varyings = {s.colors.values, 3, s.colors.rate};
    if (user) stage_scenes[n].varyings = {s.attributes, s.channels, s.rate};
  }
}

void ShadedRenderer::Impl::SetViews(std::span<const ShadedScene> scenes) {
  views.clear();
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    SceneView view = scenes[n];
    view.attributes = stage_scenes[n].varyings.values;
    view.channels = stage_scenes[n].varyings.channels, view.rate = stage_scenes[n].varyings.rate;
    views.push_back(view);
  }
}

Status ShadedRenderer::Impl::RenderStaged(const RenderOptions& options, ShadedFrame* frame) {
  const std::size_t pixels = views.size() * static_cast<std::size_t>(options.width) *
                             static_cast<std::size_t>(options.height);
  const ShadedRequest& request = forward.request;
  frame->channels = forward.varyings.width(Varying::kUser);
  frame->color.resize(request.color ? 3 * pixels : 0);
  frame->normals.resize(request.normals ? 3 * pixels : 0);
  frame->uv.resize(request.uv ? 2 * pixels : 0);
  stage.BeginForward(forward, stage_scenes, options, frame);
  return renderer.Render(views, options, request, frame, &stage);
}

// Attributes are the images themselves, or there are none.
Status ShadedRenderer::Impl::RenderPlain(const RenderOptions& options, ShadedFrame* frame) {
  RenderRequest request = forward.request;
  request.attributes = forward.colors_only || forward.user_only;
  frame->normals.clear(), frame->uv.clear();
  if (!forward.colors_only) {
    frame->color.clear();
    return renderer.Render(views, options, request, frame);
  }
  frame->attributes.swap(frame->color);
  const Status status = renderer.Render(views, options, request, frame);
  frame->attributes.swap(frame->color);
  frame->attributes.clear();
  frame->channels = 0;
  return status;
}

Status ShadedRenderer::Impl::Render(std::span<const ShadedScene> scenes,
                                    const RenderOptions& options, const ShadedRequest& request,
                                    ShadedFrame* frame) {
  TILEGRAD_TRY(ValidateOptions(options));
  TILEGRAD_ASSIGN(const SceneParts parts, ValidateShadedScenes(scenes));
  forward = PlanForward(parts, request);
  staged = forward.staged() && !scenes.empty(), was_backward = false, work = {};
  PrepareScenes(scenes, staged && forward.steps.texture);
  if (staged) {
    Pack(scenes, forward.varyings[Varying::kNormal], forward.varyings, nullptr);
  } else {
    UsePlain(scenes, forward.colors_only, forward.user_only);
  }
  SetViews(scenes);
  return staged ? RenderStaged(options, frame) : RenderPlain(options, frame);
}

// Where Renderer::Backward writes.
void ShadedRenderer::Impl::SetGradients(std::span<const ShadedScene> scenes,
                                        std::span<ShadedGradients> d_scenes) {
  d_views.clear();
  if (scratch.size() < scenes.size()) scratch.resize(scenes.size());
  const bool attributes = backward.pulled.channels() > 0;
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    SceneScratch& s = scratch[n];
    s.d_positions.resize(d_scenes[n].positions.size());
    s.d_varyings.resize(attributes ? views[n].attributes.size() : 0);
    d_views.push_back({s.d_positions, s.d_varyings, d_scenes[n].camera, {}});
  }
}

// Normals derived from positions, and positions that were interpolated.
void ShadedRenderer::Impl::NormalsBack(std::span<const ShadedScene> scenes) {
  const VaryingSet& set = backward.pulled;
  const bool derived = set[Varying::kNormal] && backward.parts.model.normals != NormalKind::kGiven;
  workers->For(scenes.size(), [&](std::size_t n, std::size_t) {
    SceneScratch& s = scratch[n];
    if (s.d_positions.empty()) return;
    if (set[Varying::kPosition]) {
      AddStream(scenes[n], set, Varying::kPosition, s.d_varyings, s.d_positions);
    }
    if (!derived) return;
    const SceneNormals& normals = packs[pack_of_scene[n]].normals;
    s.d_units.assign(normals.size(), {0, 0, 0});
    AddStream(scenes[n], set, Varying::kNormal, s.d_varyings,
              {s.d_units[0].data(), 3 * s.d_units.size()});
    AddNormalsAdjoint(scenes[n], normals, s.d_units, s.d_positions);
  });
}

void ShadedRenderer::Impl::FindSinks(std::span<ShadedGradients> d_scenes) {
  sinks.clear();
  const auto add = [&](std::span<float> out, Varying what) {
    const bool known = std::any_of(sinks.begin(), sinks.end(),
                                   [&](const Sink& s) { return s.out.data() == out.data(); });
    if (!out.empty() && !known) sinks.push_back({out, what});
  };
  for (const ShadedGradients& d : d_scenes) {
    add(d.positions, Varying::kPosition);
    for (std::size_t i = 0; i < kVaryings; ++i) {
      add(TargetOf(d, static_cast<Varying>(i)), static_cast<Varying>(i));
    }
  }
}

void ShadedRenderer::Impl::FillSink(std::span<const ShadedScene> scenes,
                                    std::span<ShadedGradients> d_scenes, const Sink& sink) {
  std::fill(sink.out.begin(), sink.out.end(), 0.0f);
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    if (sink.what == Varying::kPosition) {
      if (d_scenes[n].positions.data() != sink.out.data()) continue;
      for (std::size_t i = 0; i < sink.out.size(); ++i) sink.out[i] += scratch[n].d_positions[i];
      continue;
    }
    if (TargetOf(d_scenes[n], sink.what).data() != sink.out.data()) continue;
    if (!backward.pulled[sink.what]) continue;
    AddStream(scenes[n], backward.pulled, sink.what, scratch[n].d_varyings, sink.out);
  }
}

PlanReport ShadedRenderer::Impl::Explain() const {
  const CallWork call{renderer.stats(), renderer.times(), staged ? stage.work() : ShadeWork(),
                      work};
  return was_backward ? ReportBackward(backward, call) : ReportForward(forward, call);
}

Status ShadedRenderer::Impl::Backward(std::span<const ShadedScene> scenes,
                                      const RenderOptions& options, const ShadedFrame& frame,
                                      const ShadedFrameGradients& d_frame,
                                      std::span<ShadedGradients> d_scenes) {
  TILEGRAD_TRY(ValidateOptions(options));
  TILEGRAD_ASSIGN(const SceneParts parts, ValidateShadedScenes(scenes));
  TILEGRAD_TRY(ValidateShadedBackward(scenes, options, d_frame, d_scenes));
  backward = PlanBackward(parts, WishesOf(d_frame, d_scenes));
  staged = backward.staged() && !scenes.empty(), was_backward = true, work = {};
  PrepareScenes(scenes, staged && backward.steps.texture);
  if (staged) {
    const bool normals = backward.pulled[Varying::kNormal] || backward.recomputed[Varying::kNormal];
    const bool same = backward.pulled == backward.recomputed;
    Pack(scenes, normals, backward.pulled, same ? nullptr : &backward.recomputed);
    stage.BeginBackward(backward, stage_scenes, options, d_frame);
  } else {
    UsePlain(scenes, backward.colors_only, backward.user_only);
  }
  SetViews(scenes);
  SetGradients(scenes, d_scenes);
  TILEGRAD_TRY(RunBackward(options, frame, d_frame));
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    if (d_scenes[n].camera) d_scenes[n].d_camera = d_views[n].d_camera;
  }
  MergeBackward(scenes, d_scenes);
  return ValidateShadedResult(d_scenes);
}

Status ShadedRenderer::Impl::RunBackward(const RenderOptions& options, const ShadedFrame& frame,
                                         const ShadedFrameGradients& d_frame) {
  FrameGradients d_images{{}, d_frame.alpha};
  if (backward.colors_only) d_images.attributes = d_frame.color;
  if (backward.user_only) d_images.attributes = d_frame.attributes;
  const Status status =
      renderer.Backward(views, options, frame, d_images, d_views, staged ? &stage : nullptr);
  // Cotangents that pull nothing have been looked at by nobody.
  const bool unseen = !staged && !backward.colors_only && !backward.user_only;
  if (!status.ok() || unseen || (staged && !stage.sound())) {
    TILEGRAD_TRY(ValidateShadedCotangents(d_frame, frame.face_ids));
  }
  return status;
}

void ShadedRenderer::Impl::MergeBackward(std::span<const ShadedScene> scenes,
                                         std::span<ShadedGradients> d_scenes) {
  StageClock clock;
  ClearUniforms(d_scenes);
  if (staged) {
    NormalsBack(scenes);
    MergeUniforms(stage, stage_scenes, d_scenes, &scene_sums);
  }
  if (staged && backward.to_texture) {
    texture_merge.Run(stage, stage_scenes, *workers, d_scenes);
  } else {
    ClearTextures(d_scenes);
  }
  FindSinks(d_scenes);
  workers->For(sinks.size(),
               [&](std::size_t i, std::size_t) { FillSink(scenes, d_scenes, sinks[i]); });
  clock.Lap(&work.merge_ms);
}

ShadedRenderer::ShadedRenderer(const Workers& workers) : impl_(std::make_unique<Impl>(workers)) {}
ShadedRenderer::~ShadedRenderer() = default;
ShadedRenderer::ShadedRenderer(ShadedRenderer&&) noexcept = default;
ShadedRenderer& ShadedRenderer::operator=(ShadedRenderer&&) noexcept = default;

Status ShadedRenderer::Render(std::span<const ShadedScene> scenes, const RenderOptions& options,
                              const ShadedRequest& request, ShadedFrame* frame) {
  return impl_->Render(scenes, options, request, frame);
}

Status ShadedRenderer::Backward(std::span<const ShadedScene> scenes, const RenderOptions& options,
                                const ShadedFrame& frame, const ShadedFrameGradients& d_frame,
                                std::span<ShadedGradients> d_scenes) {
  return impl_->Backward(scenes, options, frame, d_frame, d_scenes);
}

PlanReport ShadedRenderer::Explain() const { return impl_->Explain(); }

}  // namespace tilegrad
