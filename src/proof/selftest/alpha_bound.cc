// SPDX-License-Identifier: Apache-2.0
// |alpha - equation 6 over all faces| is at most what the renderer says that it spent, which is at
// most what it was allowed; in any order of faces.
#include <algorithm>
#include <array>
#include <cstddef>

#include "proof/selftest/check.h"
#include "proof/selftest/sphere_scene.h"
#include "render/reference.h"
#include "render/renderer.h"

namespace tilegrad::selftest {
namespace {

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

// A small sphere, so that there is much of everything that may be dropped: faces that are far from
// pixels, from blocks and from whole tiles of them.
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

// What is dropped lowers alpha, so that above it there is only rounding.
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

std::vector<Check> AlphaBoundChecks() {
  return {OnEveryTarget({"alpha of all faces within its bound", AlphaIsWithinItsBound})};
}

}  // namespace tilegrad::selftest
