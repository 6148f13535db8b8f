// SPDX-License-Identifier: Apache-2.0
// Degenerate scenes: results stay finite. Input that is not finite is an error that says where.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "proof/owned_scene.h"
#include "proof/selftest/check.h"
#include "proof/selftest/sphere_scene.h"
#include "render/reference.h"
#include "render/renderer.h"

namespace tilegrad::selftest {
namespace {

// Faces without area, edge-on, behind the camera, through its plane and far beyond the image; with
// colours, to cover more than silhouettes.
OwnedScene<float> DegenerateScene() {
  OwnedScene<float> scene;
  scene.mesh.positions = {0,     0,     -1, 0,     0,     -1, 0,    0,     -1, 1, 0,    -2,
                          1,     1,     -2, 1,     0,     -4, 0,    0,     5,  1, 0,    5,
                          0,     1,     5,  -1e8f, -1e8f, -3, 1e8f, -1e8f, -3, 0, 1e8f, 1,
                          -0.5f, -0.5f, -2, 0.5f,  -0.5f, -2, 0,    0.5f,  -2};
  for (std::int32_t i = 0; i < 15; ++i) scene.mesh.faces.push_back(i);
  scene.mesh.channels = 0;
  scene.colors.assign(45, 0.5f);
  return scene;
}

template <class Vector>
Status ExpectFinite(const CheckContext& context, const std::string& what, Vector& numbers) {
  context.Take(what, numbers);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (!std::isfinite(numbers[i])) return InternalError("{}[{}] is {}", what, i, numbers[i]);
  }
  return {};
}

Status CheckFinite(const CheckContext& context, OwnedScene<float> scene, double delta) {
  RenderOptions options;
  options.delta = delta;
  Outputs request;
  OwnedCotangents<float> d_frame;
  d_frame.color.assign(3 * 64 * 64, 1.0f);
  d_frame.alpha.assign(64 * 64, 1.0f);
  OwnedRendering<float> out;
  TILEGRAD_TRY(RenderOwned(scene, options, request, d_frame, context.workers, &out));
  TILEGRAD_TRY(ExpectFinite(context, "color", out.frame.color));
  TILEGRAD_TRY(ExpectFinite(context, "alpha", out.frame.alpha));
  for (auto& [name, numbers] : NumbersOf(out.d)) {
    TILEGRAD_TRY(ExpectFinite(context, "d_" + name, numbers));
  }
  return {};
}

// Kernels from far below a pixel to far beyond the image.
Result<Finding> DegenerateFaces(const CheckContext& context) {
  for (const double delta : {1e-12, 1e-3, 1e6}) {
    const std::string place = fmt::format("delta {}", delta);
    TILEGRAD_TRY(CheckFinite(context, DegenerateScene(), delta).Within(place));
    auto flat = MakeSphere({.width = 64, .height = 64});  // a flattened sphere
    for (std::size_t i = 0; i < flat.mesh.positions.size(); i += 3) flat.mesh.positions[i] = 0;
    TILEGRAD_TRY(CheckFinite(context, flat, delta).Within(place + ", flat"));
  }
  return Finding{"finite"};
}

// A scene with one number that is not finite, and the expected text of the error.
struct BadNumber {
  const char* place;
  float* (*number)(OwnedScene<float>*);
};
constexpr BadNumber kBadNumbers[] = {
    {"positions[7]", [](OwnedScene<float>* s) { return &s->mesh.positions[7]; }},
    {"colors[11]", [](OwnedScene<float>* s) { return &s->colors[11]; }},
    {"uvs[5]", [](OwnedScene<float>* s) { return &s->uvs[5]; }},
    {"textures[0]: texels[9]", [](OwnedScene<float>* s) { return &s->textures[0].texels[9]; }},
    {"lights[1]", [](OwnedScene<float>* s) { return &s->lights[1].intensity; }},
};

Status CheckRefused(const CheckContext& context, const BadNumber& bad, float value) {
  auto scene = MakeSphere({});
  *bad.number(&scene) = value;
  Renderer renderer = RendererOn(context.workers);
  const Scene view = scene.View();
  Frame frame;
  const Status status = renderer.Render({&view, 1}, SphereOptions({}), {}, &frame);
  std::string message = status.message();
  std::vector<std::uint8_t> text(message.begin(), message.end());
  context.Take("message", text);
  message.assign(text.begin(), text.end());
  if (status.ok()) return InternalError("{} is {}, but no error was reported", bad.place, value);
  if (message.find(bad.place) != std::string::npos) return {};
  return InternalError("{} is {}, but the error is: {}", bad.place, value, message);
}

Result<Finding> NumbersThatAreNone(const CheckContext& context) {
  for (const BadNumber& bad : kBadNumbers) {
    for (const float value :
         {std::numeric_limits<float>::quiet_NaN(), -std::numeric_limits<float>::infinity()}) {
      TILEGRAD_TRY(CheckRefused(context, bad, value));
    }
  }
  return Finding{"errors that name array and index"};
}

// |alpha - equation 6 over all faces| is at most the reported error, which is at most the allowed
// one; in any order of faces.

// Rounding comes on top. By docs/numerics.md, "Rounding", it makes alpha err by at most 75 u +
// 0.69 (34 z + (40 r + 31 l) d) u, u = 2^-24, d^2 = z = log2(1280), where 1,280 faces count for
// no more than one. In kernel units half the diagonal of a block is r = 7.8 and the longest edge l
// = 1.2 with delta = 1e-3: 6.5e-5; both are sqrt(10) times less with 1e-2: 3.3e-5. Projection errs
// by 8 eps in NDC, eps = 2^-23, so alpha by 2 sqrt(ln 1280) 8 eps / sqrt(delta): 1.6e-4 and 5e-5.
struct BoundCase {
  double delta, rounding;
  std::array<double, 3> errors;  // max_alpha_error
};
constexpr BoundCase kCases[] = {{1e-2, 8.4e-5, {1e-2, 1e-3, 0}}, {1e-3, 2.3e-4, {1e-2, 1e-3, 0}}};

// A small sphere, with many faces of every kind that may be dropped: far from pixels, from blocks
// and from whole tiles of them.
struct BoundScene {
  OwnedMesh<float> mesh;
  RenderOptions options;

  explicit BoundScene(double delta) {
    const SphereShape shape{.level = 3, .width = 48, .height = 48};
    mesh = MakeSphere(shape).mesh;
    for (float& p : mesh.positions) p *= 0.25f;
    options = SphereOptions(shape);
    options.delta = delta;
  }
  void ShuffleFaces() {
    Rng rng(4, 22);
    const auto begin = mesh.faces.begin();
    for (std::ptrdiff_t n = std::ssize(mesh.faces) - 3; n > 0; n -= 3) {
      const auto other =
          3 * static_cast<std::ptrdiff_t>(rng.Below(static_cast<std::uint64_t>(n / 3)));
      std::swap_ranges(begin + n, begin + n + 3, begin + other);
    }
  }
};

Result<std::vector<double>> TrueAlpha(const BoundScene& scene) {
  const auto mesh = MeshCast<double>(scene.mesh);
  const SceneT<double> view = mesh.View();
  FrameImagesT<double> frame;
  ReferenceRender<double>(view, scene.options, {.color = false, .attributes = false},
                          FaceIdsRef(view, scene.options), &frame);
  const auto between = std::count_if(frame.alpha.begin(), frame.alpha.end(),
                                     [](double a) { return a > 0.01 && a < 0.99; });
  if (between < 20) return InternalError("{} pixels have an alpha between 0 and 1", between);
  return std::vector<double>(frame.alpha.begin(), frame.alpha.end());
}

// Dropping lowers alpha, so only rounding can raise it.
Status CheckBound(const CheckContext& context, const BoundScene& scene, double rounding,
                  const std::vector<double>& want, Gauge* gauge) {
  Frame frame;
  const Scene view = scene.mesh.View();
  TILEGRAD_TRY(
      RendererOn(context.workers)
          .Render({&view, 1}, scene.options, {.color = false, .attributes = false}, &frame));
  const std::span<const float> rendered = frame.images().alpha;
  std::vector<float> alpha(rendered.begin(), rendered.end());
  std::vector<double> spent = {frame.images().alpha_error_bound};
  context.Take("alpha", alpha);
  context.Take("alpha_error_bound", spent);
  if (!(spent[0] <= scene.options.max_alpha_error + 1e-28)) {  // n 2^-126 if none is allowed
    return InternalError("alpha_error_bound is {:.3g}", spent[0]);
  }
  return gauge->ExpectEach("alpha", alpha, want, [&](std::size_t i) {
    return static_cast<double>(alpha[i]) > want[i] ? rounding : spent[0] + rounding;
  });
}

Status CheckCase(const CheckContext& context, const BoundCase& c, Gauge* gauge) {
  BoundScene scene(c.delta);
  TILEGRAD_ASSIGN(const auto want, TrueAlpha(scene));
  for (const char* order : {"faces in order", "faces shuffled"}) {
    for (const double error : c.errors) {
      scene.options.max_alpha_error = error;
      TILEGRAD_TRY(CheckBound(context, scene, c.rounding, want, gauge)
                       .Within(fmt::format("max_alpha_error {}, {}", error, order)));
    }
    scene.ShuffleFaces();
  }
  return {};
}

Result<Finding> AlphaIsWithinItsBound(const CheckContext& context) {
  Gauge gauge;
  for (const BoundCase& c : kCases) {
    TILEGRAD_TRY(CheckCase(context, c, &gauge).Within(fmt::format("delta {}", c.delta)));
  }
  return gauge.Found();
}

}  // namespace

std::vector<Check> ExtremeChecks() {
  return {OnEveryTarget({"degenerate, huge and hidden faces", DegenerateFaces}),
          OnEveryTarget({"NaN and infinity in a scene", NumbersThatAreNone})};
}

std::vector<Check> AlphaBoundChecks() {
  return {OnEveryTarget({"alpha of all faces within its bound", AlphaIsWithinItsBound})};
}

}  // namespace tilegrad::selftest
