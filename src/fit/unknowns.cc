// SPDX-License-Identifier: Apache-2.0
#include "fit/unknowns.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "scene/camera_conventions.h"
#include "tilegrad/camera.h"

namespace tilegrad::train {
namespace {

constexpr float kMostShininess = 1e5f;
constexpr float kMostLogGain = 3, kMostLogFocal = 1.5f;  // a factor of 20, and of 4.5
constexpr std::int64_t kReflectances = 9, kMaterialNumbers = 10;
constexpr std::size_t kFirstIntrinsic = 12;

// R c, for the pivot c.
float TurnedPivot(const FitScene& scene, const float* rotation, int row) {
  const float* r = rotation + 3 * row;
  return r[0] * scene.pivot[0] + r[1] * scene.pivot[1] + r[2] * scene.pivot[2];
}

std::vector<float> NumbersOf(const FitScene& scene, const Camera& camera) {
  const CameraParameters p = ParametersOf(camera);
  std::vector<float> out(p.rotation, p.rotation + 6);
  for (int r = 0; r < 3; ++r)
    out.push_back((camera.translation[r] + TurnedPivot(scene, camera.rotation, r)) / scene.unit);
  return out;
}

// Six numbers of rotation; all else is that of `camera`.
CameraParameters WithRotation(const Camera& camera, const float* numbers) {
  CameraParameters p = ParametersOf(camera);
  std::copy_n(numbers, 6, p.rotation);
  return p;
}

// The camera that nine numbers mean, with the lens of `camera`.
Result<Camera> CameraOf(const FitScene& scene, const Camera& camera, const float* numbers) {
  TILEGRAD_ASSIGN(Camera moved,
                  CameraFromParameters(WithRotation(camera, numbers), camera.near_plane));
  for (int r = 0; r < 3; ++r)
    moved.translation[r] = scene.unit * numbers[6 + r] - TurnedPivot(scene, moved.rotation, r);
  return moved;
}

// dL/d(numbers) from dL/d(row of SceneVars::cameras): t = unit v - R c.
void PullCamera(const FitScene& scene, const Camera& camera, const float* numbers,
                const float* d_row, float* d_numbers) {
  Camera d{};
  const float* const d_translation = d_row + 9;
  for (int i = 0; i < 9; ++i)
    d.rotation[i] = d_row[i] - d_translation[i / 3] * scene.pivot[static_cast<std::size_t>(i % 3)];
  std::copy_n(PullBack(WithRotation(camera, numbers), d).rotation, 6, d_numbers);
  for (int r = 0; r < 3; ++r) d_numbers[6 + r] = scene.unit * d_translation[r];
}

// [9] -> [1,16], a row of SceneVars::cameras.
nn::Var CameraRow(const FitScene& scene, const Camera& camera, const nn::Var& numbers) {
  nn::Context& context = numbers.context();
  const nn::Tensor& at = numbers.value();
  const auto moved = CameraOf(scene, camera, at.data<float>());
  if (!moved.ok()) return nn::Fail(numbers, moved.status());
  nn::Tensor row = context.Empty({1, kCameraNumbers}, nn::DType::kF32);
  float* to = row.data<float>();
  ForEachCameraNumber(*moved, [&](float number) { *to++ = number; });
  auto backward = [&scene, &context, camera, at](std::span<const nn::Tensor> d) {
    nn::Tensor d_numbers = context.Empty(at.shape(), nn::DType::kF32);
    PullCamera(scene, camera, at.data<float>(), d[0].data<float>(), d_numbers.data<float>());
    return std::vector<nn::Tensor>{d_numbers};
  };
  return nn::External(context, {.name = "camera",
                                .inputs = {numbers},
                                .outputs = {row},
                                .backward = std::move(backward)})[0];
}

std::vector<float> NumbersOf(const Surface& s) {
  std::vector<float> out(s.ambient.begin(), s.ambient.end());
  out.insert(out.end(), s.diffuse.begin(), s.diffuse.end());
  out.insert(out.end(), s.specular.begin(), s.specular.end());
  out.push_back(std::log(s.shininess + 1));
  return out;
}

void TakeSurface(const float* from, Surface* s) {
  std::copy_n(from, 3, s->ambient.begin());
  std::copy_n(from + 3, 3, s->diffuse.begin());
  std::copy_n(from + 6, 3, s->specular.begin());
  s->shininess = std::clamp(std::exp(from[9]) - 1, 0.0f, kMostShininess);
}

// Writing this twice changes nothing: the second sum is 1, to the bit.
void HoldMean(float* ambient, float* diffuse) {
  for (int c = 0; c < 3; ++c) {
    const float sum = ambient[c] + diffuse[c] / kDirectionsPerMean;
    ambient[c] = sum > 0 ? ambient[c] / sum : 1;
    diffuse[c] = kDirectionsPerMean * (1 - ambient[c]);
  }
}

// Of what is a block as it is.
template <class Scene>  // FitScene, const or not
auto ArrayOf(Scene& scene, Parameter what) {
  using Numbers = decltype(std::span(scene.positions));
  switch (what) {
    case Parameter::kPositions:
      return Numbers(scene.positions);
    case Parameter::kColors:
      return Numbers(scene.colors);
    case Parameter::kTexture:
      return Numbers(scene.texture.pixels);
    case Parameter::kUv:
      return Numbers(scene.uvs);
    case Parameter::kLight:
      return Numbers(scene.light);
    case Parameter::kSh:
      return Numbers(scene.sh);
    default:
      return Numbers();
  }
}

// The numbers of a block at first.
std::vector<float> NumbersOf(const FitScene& scene, Parameter what, std::size_t view) {
  switch (what) {
    case Parameter::kCamera:
      return NumbersOf(scene, scene.cameras[view]);
    case Parameter::kMaterial:
      return NumbersOf(scene.surface);
    case Parameter::kExposure:
      return {std::log(scene.gains[view])};
    case Parameter::kFocal:
      return {0.0f};
    default: {
      const auto array = ArrayOf(scene, what);
      return {array.begin(), array.end()};
    }
  }
}

nn::Shape ShapeOf(const FitScene& scene, Parameter what, std::int64_t numbers) {
  switch (what) {
    case Parameter::kPositions:
    case Parameter::kColors:
      return {1, numbers / 3, 3};
    case Parameter::kTexture:
      return {1, scene.texture.height, scene.texture.width, 3};
    case Parameter::kUv:
      return {numbers / 2, 2};
    case Parameter::kLight:
    case Parameter::kSh:
    case Parameter::kMaterial:
      return {1, numbers};
    default:
      return {numbers};
  }
}

void Clamp(float low, float high, std::span<float> values) {
  for (float& x : values) x = std::min(std::max(x, low), high);  // no branches
}

}  // namespace

std::string ParameterBlock::name() const {
  return view < 0 ? NameOf(what) : fmt::format("{}/{}", NameOf(what), view);
}

Unknowns::Unknowns(nn::Context& context, const FitScene& scene, const ParameterSet& free)
    : context_(context), scene_(scene), free_(free) {
  for (const Camera& c : scene.cameras) focal_.push_back({c.fx, c.fy});
  for (const Parameter what : kParameters) {
    if (!IsThere(what)) continue;
    if (!IsOfOneView(what)) Add(what);
    const std::size_t views =
        what == Parameter::kExposure ? scene.gains.size() : scene.cameras.size();
    for (int i = 0; IsOfOneView(what) && i < static_cast<int>(views); ++i) Add(what, i);
  }
  if (!scene.texture.empty()) uv_indices_ = context.Indices(scene.uv_indices);
}

bool Unknowns::IsThere(Parameter what) const {
  switch (what) {
    case Parameter::kPositions:
      return true;
    case Parameter::kExposure:
      return !scene_.gains.empty();
    case Parameter::kCamera:
    case Parameter::kFocal:
      return free_[Parameter::kCamera] || free_[Parameter::kFocal];
    case Parameter::kMaterial:
      return free_[what];
    default:
      return WhyExcluded(scene_, what).empty() ||
             (what == Parameter::kUv && !scene_.texture.empty());
  }
}

void Unknowns::Add(Parameter what, int view) {
  const auto numbers = NumbersOf(scene_, what, static_cast<std::size_t>(std::max(view, 0)));
  const nn::Tensor value =
      context_.From(ShapeOf(scene_, what, std::ssize(numbers)), std::span<const float>(numbers));
  blocks_.push_back(
      {what, view, free_[what] ? nn::Parameter(context_, value) : nn::Constant(context_, value)});
}

const nn::Var& Unknowns::Of(Parameter what, int view) const {
  static const nn::Var kNone;
  const auto at = std::ranges::find_if(
      blocks_, [&](const ParameterBlock& b) { return b.what == what && b.view == view; });
  return at == blocks_.end() ? kNone : at->value;
}

RenderJob Unknowns::JobOf(const FitRenderer::Job& job) const {
  RenderJob out;
  out.faces = scene_.faces;
  out.views = static_cast<int>(job.views.size());
  for (const int view : job.views)
    out.cameras.push_back(ScaledCamera(scene_.cameras[static_cast<std::size_t>(view)], job.scale));
  out.options = job.options;
  out.alpha = job.alpha;
  out.wrap = scene_.wrap;
  out.filter = scene_.filter;
  out.shading = scene_.shading;
  if (scene_.uses_lights()) out.surface = scene_.surface;
  return out;
}

// The mean of the light is that of the first.
nn::Var Unknowns::Harmonics() const {
  const nn::Var& sh = Of(Parameter::kSh);
  if (!scene_.light_mean_fixed) return sh;
  return nn::Concat({nn::Detach(nn::Slice(sh, 1, 0, 1)), nn::Slice(sh, 1, 1, 9)}, 1);
}

// Intrinsics are those of the scene at first, times the scale and the factor of focal lengths.
nn::Var Unknowns::Cameras(const FitRenderer::Job& job) const {
  std::vector<nn::Var> rows;
  for (const int view : job.views) {
    const auto v = static_cast<std::size_t>(view);
    Camera camera = scene_.cameras[v];
    camera.fx = focal_[v][0];
    camera.fy = focal_[v][1];
    rows.push_back(CameraRow(scene_, camera, Of(Parameter::kCamera, view)));
  }
  std::array<float, kCameraNumbers> fixed = {}, focal = {};
  std::fill_n(fixed.begin(), kFirstIntrinsic, 1.0f);
  std::fill_n(focal.begin() + kFirstIntrinsic, 2, job.scale);
  std::fill_n(fixed.begin() + kFirstIntrinsic + 2, 2, job.scale);
  const auto numbers = [&](const std::array<float, kCameraNumbers>& of) {
    return nn::Constant(context_, context_.From({1, kCameraNumbers}, std::span<const float>(of)));
  };
  const nn::Var factors = numbers(fixed) + numbers(focal) * nn::Exp(Of(Parameter::kFocal));
  return nn::Concat(rows, 0) * factors;
}

SceneVars Unknowns::VarsOf(const FitRenderer::Job& job) const {
  const auto images = static_cast<std::int64_t>(job.views.size());
  SceneVars out{.positions = Of(Parameter::kPositions),
                .colors = Of(Parameter::kColors),
                .textures = Of(Parameter::kTexture)};
  if (out.textures.valid()) {
    out.uvs = nn::Reshape(nn::Gather(Of(Parameter::kUv), 0, uv_indices_), {-1, 3, 2});
  }
  if (const nn::Var& light = Of(Parameter::kLight); light.valid())
    out.light_directions = nn::BroadcastTo(light, {images, 3});
  if (Of(Parameter::kSh).valid()) out.sh = nn::BroadcastTo(Harmonics(), {images, 9});
  if (const nn::Var& material = Of(Parameter::kMaterial); material.valid()) {
    out.reflectance =
        nn::BroadcastTo(nn::Slice(material, 1, 0, kReflectances), {images, kReflectances});
    const nn::Var last = nn::Slice(material, 1, kReflectances, kMaterialNumbers);
    out.shininess = nn::BroadcastTo(nn::Reshape(nn::Exp(last) - 1, {1}), {images});
  }
  if (Of(Parameter::kFocal).valid()) out.cameras = Cameras(job);
  return out;
}

nn::Var Unknowns::Gains(std::span<const int> views) const {
  if (!IsThere(Parameter::kExposure)) return {};
  std::vector<nn::Var> logarithms;
  for (const int view : views) logarithms.push_back(Of(Parameter::kExposure, view));
  return nn::Reshape(nn::Exp(nn::Concat(logarithms, 0)), {-1, 1, 1, 1});
}

RenderedImages Unknowns::Render(SceneRenderer* renderer, const FitRenderer::Job& job) const {
  return RenderScenes(*renderer, VarsOf(job), JobOf(job));
}

void Unknowns::WriteFocal(float logarithm, FitScene* scene) const {
  for (std::size_t i = 0; i < focal_.size(); ++i) {
    scene->cameras[i].fx = std::exp(logarithm) * focal_[i][0];
    scene->cameras[i].fy = std::exp(logarithm) * focal_[i][1];
  }
}

Status Unknowns::Write(const ParameterBlock& block, FitScene* scene) const {
  nn::Tensor value = block.value.value();
  const std::span<float> x = value.span<float>();
  const auto view = static_cast<std::size_t>(std::max(block.view, 0));
  switch (block.what) {
    case Parameter::kColors:
    case Parameter::kTexture:
      Clamp(0, 1, x);
      break;
    case Parameter::kMaterial:
      Clamp(0, std::log(kMostShininess), x);
      if (scene->light_mean_fixed) HoldMean(x.data(), x.data() + 3);
      TakeSurface(x.data(), &scene->surface);
      break;
    case Parameter::kExposure:
      Clamp(-kMostLogGain, kMostLogGain, x);
      scene->gains[view] = std::exp(x[0]);
      break;
    case Parameter::kFocal:
      Clamp(-kMostLogFocal, kMostLogFocal, x);
      WriteFocal(x[0], scene);
      break;
    case Parameter::kCamera: {
      Camera& camera = scene->cameras[view];
      auto moved = CameraOf(*scene, camera, x.data());
      if (!moved.ok()) return moved.status().Within(fmt::format("camera {}", block.view));
      camera = *moved;
      break;
    }
    default:
      break;
  }
  if (const auto array = ArrayOf(*scene, block.what); !array.empty())
    std::ranges::copy(x, array.begin());
  return {};
}

}  // namespace tilegrad::train
