// SPDX-License-Identifier: Apache-2.0
// All images and gradients of a sphere: the engine against the reference in double, and the
// reference's gradients against complex steps.
#include <algorithm>

#include "proof/complex_step.h"
#include "proof/selftest/check.h"
#include "proof/selftest/sphere_scene.h"
#include "render/scene_fields.h"
#include "scene/shapes.h"

namespace tilegrad::selftest {
namespace {

using Gradients = std::map<std::string, std::vector<double>>;

// Whether numbers of the sphere have a nonzero gradient under this lighting.
bool HasGradient(Lighting lighting, const std::string& kind) {
  if (kind == "specular" || kind == "shininess") return lighting == Lighting::kPhong;
  if (kind == "ambient" || kind == "diffuse") return UsesLights({.lighting = lighting});
  return true;  // and only lights that are there have numbers
}

template <class Frame>
void TakeImages(const CheckContext& context, Frame* frame) {
  context.Take("face_ids", frame->face_ids);
  context.Take("color", frame->color);
  context.Take("alpha", frame->alpha);
  context.Take("depth", frame->depth);
  context.Take("normals", frame->normals);
  context.Take("uv", frame->uv);
}

template <class T>
Gradients TakeGradients(const CheckContext& context, OwnedScene<T>& d) {
  Gradients out;
  for (auto& [name, numbers] : NumbersOf(d)) {
    context.Take("d_" + name, numbers);
    out[name].assign(numbers.begin(), numbers.end());
  }
  return out;
}

// Vertices are rounded to 1/1024 pixel before visibility is decided. No pixel centre of this sphere
// is so near to an edge that earlier rounding could decide: moving all numbers of the scene by up
// to two units in the last place changes nothing.
Status ExpectFaceIds(std::span<const std::int32_t> got, std::span<const std::int32_t> want) {
  const auto covered = std::count_if(want.begin(), want.end(), [](int id) { return id >= 0; });
  if (covered < 300) return InternalError("the sphere covers {} pixels only", covered);
  return Gauge().Expect("face_ids", got, want, 0);
}

// A weight errs by 16 eps W + 1e-5, eps = 2^-23, W = 32 pixels, on faces down to a quarter of a
// pixel in height: 7e-5. A gradient has one weight and one 1/height more and errs by eight times
// that, relative to its largest entry. Light and texture have errors of their own, but most faces
// are ten times as high.
constexpr double kShare = 5.7e-4;

struct BothRenderings {
  OwnedRendering<float> got;
  OwnedRendering<double> want;
};

Status ExpectReference(const CheckContext& context, Lighting lighting, BothRenderings* both,
                       Gauge* gauge) {
  TakeImages(context, &both->got.frame);
  const auto& got = both->got.frame;
  const auto& want = both->want.frame;
  TILEGRAD_TRY(gauge->ExpectOfLargest("color", got.color, want.color, kShare));
  TILEGRAD_TRY(gauge->ExpectOfLargest("alpha", got.alpha, want.alpha, kShare));
  TILEGRAD_TRY(gauge->ExpectOfLargest("depth", got.depth, want.depth, kShare));
  TILEGRAD_TRY(gauge->ExpectOfLargest("normals", got.normals, want.normals, kShare));
  TILEGRAD_TRY(gauge->ExpectOfLargest("uv", got.uv, want.uv, kShare));
  Gradients d_got = TakeGradients(context, both->got.d);
  for (const auto& [kind, numbers] : NumbersOf(both->want.d)) {
    const bool none = !HasGradient(lighting, kind);
    TILEGRAD_TRY(none ? gauge->Expect("d_" + kind, d_got[kind], numbers, 0)
                      : gauge->ExpectOfLargest("d_" + kind, d_got[kind], numbers, kShare));
  }
  return {};
}

Status CheckSphere(const CheckContext& context, const SphereShape& shape, Gauge* gauge) {
  const RenderOptions options = SphereOptions(shape);
  auto scene = MakeSphere(shape);
  auto scene64 = OwnedCast<double>(scene);
  Rng rng(1, 21);
  const OwnedCotangents<double> d_frame(1024, 0, &rng);
  BothRenderings both;
  TILEGRAD_TRY(RenderOwned(scene, options, ImagesWithGradients(), d_frame.Cast<float>(),
                           context.workers, &both.got));
  // The reference uses the engine's visibility, which is checked separately.
  both.want = RenderOwnedRef<double>(scene64, options, ImagesWithGradients(), d_frame,
                                     both.got.frame.face_ids);
  TILEGRAD_TRY(ExpectReference(context, shape.lighting, &both, gauge));
  return ExpectFaceIds(both.got.frame.face_ids, FaceIdsRef(scene64.mesh.View(), options));
}

Result<Finding> EngineIsTheReference(const CheckContext& context) {
  Gauge gauge;
  for (const auto& [name, shape] : kSpheres) {
    TILEGRAD_TRY(CheckSphere(context, shape, &gauge).Within(name));
  }
  return gauge.Found();
}

Status CheckSlope(const SlopeProblem& problem, const std::string& kind,
                  const std::vector<double>& gradient, Gauge* gauge) {
  const Slope slope = SlopeAlong(problem, kind, gradient, Rng(2, 21));
  if (slope.size == 0) return InternalError("d_{}: all {} numbers are 0", kind, slope.count);
  const double got[] = {slope.by_gradient}, want[] = {slope.by_step};
  return gauge->Expect("slope of the loss along " + kind, got, want, slope.rounding());
}

Status CheckSteps(const CheckContext& context, SphereShape shape, Gauge* gauge) {
  shape.level = 1;
  shape.width = shape.height = 16;
  const RenderOptions options = SphereOptions(shape);
  const auto scene = MakeSphere(shape);
  auto scene64 = OwnedCast<double>(scene);
  const auto ids = FaceIdsRef(scene64.mesh.View(), options);
  Rng rng(3, 21);
  const OwnedCotangents<double> d_frame(ids.size(), 0, &rng);
  auto d = OwnedRefBackward<double>(scene64, options, d_frame, ids);
  const Outputs request = ImagesWithGradients();
  const SlopeProblem problem{scene, options, request, ids, d_frame};
  for (const auto& [kind, gradient] : TakeGradients(context, d)) {
    TILEGRAD_TRY(
        HasGradient(shape.lighting, kind)
            ? CheckSlope(problem, kind, gradient, gauge)
            : gauge->Expect("d_" + kind, gradient, std::vector<double>(gradient.size()), 0));
  }
  return {};
}

Result<Finding> ReferenceIsTheComplexStep(const CheckContext& context) {
  Gauge gauge;
  for (const auto& [name, shape] : kSpheres) {
    TILEGRAD_TRY(CheckSteps(context, shape, &gauge).Within(name));
  }
  return gauge.Found();
}

float Random(Rng* rng, double low, double high) {
  return static_cast<float>(rng->Uniform(low, high));
}

std::vector<float> RandomNumbers(std::size_t count, double low, double high, Rng* rng) {
  std::vector<float> out(count);
  for (float& x : out) x = Random(rng, low, high);
  return out;
}

std::array<float, 3> RandomTriple(double low, double high, Rng* rng) {
  return {Random(rng, low, high), Random(rng, low, high), Random(rng, low, high)};
}

// At a distance of three from the origin, looking at it from the side; with this f a sphere of 0.8
// leaves a sixth of the image free on each side.
CameraT<float> SideCamera(const SphereShape& shape) {
  CameraT<float> camera;
  constexpr double kAxes[9] = {2.0 / 3, -2.0 / 3, 1.0 / 3,  1.0 / 3, 2.0 / 3,
                               2.0 / 3, -2.0 / 3, -1.0 / 3, 2.0 / 3};
  std::transform(kAxes, kAxes + 9, camera.rotation, [](double x) { return static_cast<float>(x); });
  camera.translation[2] = -3;
  camera.fx = camera.fy = 1.25f * static_cast<float>(std::min(shape.width, shape.height));
  camera.cx = 0.5f * static_cast<float>(shape.width);
  camera.cy = 0.5f * static_cast<float>(shape.height);
  camera.near_plane = shape.near_plane;
  return camera;
}

void AddMesh(const SphereShape& shape, Rng* rng, OwnedScene<float>* scene) {
  const Mesh sphere = Icosphere(shape.level, 0.8f);
  for (const glm::vec3& p : sphere.positions) {
    for (int k = 0; k < 3; ++k) {
      scene->mesh.positions.push_back(p[k] + Random(rng, -0.01, 0.01));
    }
  }
  for (const Face& face : sphere.faces) {
    scene->mesh.faces.insert(scene->mesh.faces.end(), face.begin(), face.end());
  }
  scene->mesh.channels = 0;
  scene->mesh.camera = SideCamera(shape);
}

// Coordinates from x and y, so that a texel is several pixels.
void AddTexture(Filter filter, Rng* rng, OwnedScene<float>* scene) {
  for (std::size_t v = 0; v < scene->mesh.vertex_count(); ++v) {
    for (const std::size_t k : {0u, 1u}) {
      scene->uvs.push_back(0.5f + 0.4f * scene->mesh.positions[3 * v + k]);
    }
  }
  scene->uvs_rate = Rate::kVertex;
  scene->textures.push_back({RandomNumbers(8 * 7 * 3, 0.2, 0.9, rng), 8, 7, Wrap::kRepeat, filter});
}

void AddSurfaces(Rng* rng, OwnedScene<float>* scene) {
  for (int k = 0; k < 2; ++k) {
    scene->surfaces.push_back({RandomTriple(0.5, 1, rng), k - 1, RandomTriple(0.1, 0.3, rng),
                               RandomTriple(0.5, 1, rng), RandomTriple(0.2, 0.5, rng),
                               Random(rng, 4, 10)});
  }
  for (std::size_t f = 0; f < scene->mesh.face_count(); ++f) {
    scene->face_surfaces.push_back(static_cast<std::int32_t>(rng->Below(2)));
  }
}

void AddLight(const SphereShape& shape, Rng* rng, OwnedScene<float>* scene) {
  scene->shading.lighting = shape.lighting;
  scene->shading.normals = shape.normals;
  scene->shading.two_sided = true;
  if (shape.lighting == Lighting::kSphericalHarmonics) scene->sh = RandomNumbers(9, 0.1, 0.5, rng);
  if (!UsesLights(scene->shading)) return;
  scene->lights = {{{0.3f, 0.5f, 1.0f}, 0.8f}, {{-1.0f, 0.7f, 0.9f}, 0.4f}};
}

}  // namespace

std::vector<Check> SphereChecks() {
  return {OnEveryTarget({"images and gradients of a sphere, beside float64", EngineIsTheReference}),
          {"gradients of float64, beside complex steps", ReferenceIsTheComplexStep}};
}

OwnedScene<float> MakeSphere(const SphereShape& shape) {
  Rng rng(shape.seed, 20);
  OwnedScene<float> scene;
  AddMesh(shape, &rng, &scene);
  scene.colors = RandomNumbers(scene.mesh.positions.size(), 0.2, 0.9, &rng);
  AddTexture(shape.filter, &rng, &scene);
  AddSurfaces(&rng, &scene);
  AddLight(shape, &rng, &scene);
  return scene;
}

Outputs ImagesWithGradients() {
  Outputs request;
  request.depth = request.normals = request.uv = true;
  return request;
}

RenderOptions SphereOptions(const SphereShape& shape) {
  RenderOptions options;
  options.width = shape.width;
  options.height = shape.height;
  options.delta = 1e-2;
  options.max_alpha_error = 1e-7;
  return options;
}

}  // namespace tilegrad::selftest
