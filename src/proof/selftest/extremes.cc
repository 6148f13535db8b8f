// SPDX-License-Identifier: Apache-2.0
// Scenes that formulas are not made for: numbers stay numbers. Numbers that are none are errors
// that say where.
#include <cmath>
#include <limits>

#include "proof/owned_scene.h"
#include "proof/selftest/check.h"
#include "proof/selftest/sphere_scene.h"
#include "render/renderer.h"

namespace tilegrad::selftest {
namespace {

// Faces without area, seen from the edge, behind the camera, through its plane and far beyond the
// image; colours, so that there is more than a silhouette.
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
    auto flat = MakeSphere({.width = 64, .height = 64});  // a sphere without thickness
    for (std::size_t i = 0; i < flat.mesh.positions.size(); i += 3) flat.mesh.positions[i] = 0;
    TILEGRAD_TRY(CheckFinite(context, flat, delta).Within(place + ", flat"));
  }
  return Finding{"finite"};
}

// A scene with one number that is none, and what must stand in the error.
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

}  // namespace

std::vector<Check> ExtremeChecks() {
  return {OnEveryTarget({"degenerate, huge and hidden faces", DegenerateFaces}),
          OnEveryTarget({"NaN and infinity in a scene", NumbersThatAreNone})};
}

}  // namespace tilegrad::selftest
