// SPDX-License-Identifier: Apache-2.0
// One triangle, whose images have closed formulas.
#include <algorithm>
#include <array>
#include <cmath>
#include <type_traits>

#include "proof/owned_scene.h"
#include "proof/selftest/check.h"

namespace tilegrad::selftest {
namespace {

using Point = std::array<double, 2>;

// No pixel centre is nearer than 1/50 pixel to an edge, so that neither rounding nor the snapping
// of vertices to 1/1024 pixel decides coverage. Depths differ.
constexpr std::array<std::array<double, 3>, 3> kCorners = {
    {{-0.61, -0.43, -2.0}, {0.57, -0.52, -2.5}, {0.08, 0.66, -1.5}}};
constexpr std::array<std::array<double, 3>, 3> kColors = {
    {{0.9, 0.1, 0.2}, {0.2, 0.8, 0.3}, {0.1, 0.3, 0.7}}};
constexpr int kSize = 64;  // pixels a side; the default camera is made for them
constexpr std::size_t kPixels = kSize * kSize;
constexpr double kDelta = 1e-3;

Point Pixel(std::size_t i) {
  return {static_cast<double>(i % kSize) + 0.5, static_cast<double>(i / kSize) + 0.5};
}

// Corner k in pixels: the camera stands at the origin, looks along -z, has f = 64, c = 32.
Point Corner(std::size_t k) {
  const auto& p = kCorners[k];
  return {32 + 64 * p[0] / -p[2], 32 - 64 * p[1] / -p[2]};
}

double Cross(const Point& a, const Point& b, const Point& p) {
  return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
}

// Linear on the screen; all positive inside.
std::array<double, 3> ScreenWeights(const Point& p) {
  const double area = Cross(Corner(0), Corner(1), Corner(2));
  return {Cross(Corner(1), Corner(2), p) / area, Cross(Corner(2), Corner(0), p) / area,
          Cross(Corner(0), Corner(1), p) / area};
}

bool Inside(const Point& p) {
  const auto weights = ScreenWeights(p);
  return *std::min_element(weights.begin(), weights.end()) > 0;
}

// To the outline, in NDC: 2 / kSize a pixel.
double Distance(const Point& p) {
  double nearest = INFINITY;
  for (std::size_t k = 0; k < 3; ++k) {
    const Point a = Corner(k), b = Corner((k + 1) % 3), ab = {b[0] - a[0], b[1] - a[1]};
    const double along = (p[0] - a[0]) * ab[0] + (p[1] - a[1]) * ab[1];
    const double t = std::clamp(along / (ab[0] * ab[0] + ab[1] * ab[1]), 0.0, 1.0);
    nearest = std::min(nearest, std::hypot(p[0] - a[0] - t * ab[0], p[1] - a[1] - t * ab[1]));
  }
  return nearest * 2 / kSize;
}

template <class T>
OwnedScene<T> TriangleScene() {
  OwnedScene<T> scene;
  for (const auto& p : kCorners) {
    scene.mesh.positions.insert(scene.mesh.positions.end(), {T(p[0]), T(p[1]), T(p[2])});
  }
  for (const auto& c : kColors) {
    scene.colors.insert(scene.colors.end(), {T(c[0]), T(c[1]), T(c[2])});
  }
  scene.mesh.faces = {0, 1, 2};
  scene.mesh.channels = 0;
  return scene;
}

template <class T>
Result<FrameImagesT<T>> RenderTriangle(const Workers& workers) {
  auto scene = TriangleScene<T>();
  RenderOptions options;
  options.width = options.height = kSize;
  options.delta = kDelta;
  Outputs request;
  request.depth = true;
  FrameImagesT<T> frame;
  if constexpr (std::is_same_v<T, float>) {
    const Scene view = scene.View();
    Frame rendered;
    TILEGRAD_TRY(RendererOn(workers).Render({&view, 1}, options, request, &rendered));
    frame = OwnedImages(rendered.images());
  } else {
    const auto ids = FaceIdsRef(scene.mesh.View(), options);
    ReferenceRender<T>(scene.View(), options, request, ids, &frame);
  }
  return frame;
}

// Pixels whose centre is inside, and no others.
template <class T>
Result<Finding> Coverage(const CheckContext& context) {
  TILEGRAD_ASSIGN(auto frame, RenderTriangle<T>(context.workers));
  context.Take("face_ids", frame.face_ids);
  std::vector<int> want;
  for (std::size_t i = 0; i < kPixels; ++i) want.push_back(Inside(Pixel(i)) ? 0 : -1);
  const auto covered = std::count(want.begin(), want.end(), 0);
  if (covered < 300) return InternalError("the triangle covers {} pixels only", covered);
  Gauge gauge;
  TILEGRAD_TRY(gauge.Expect("face_ids", frame.face_ids, want, 0));
  return Finding{fmt::format("{} pixels, and no others", covered)};
}

// Equations 5 and 6: 1 inside, exp(-d^2 / delta) outside.
//
// In float, pixel coordinates err by 4 eps W pixels, eps = 2^-23, or 8 eps in NDC, so that
// exp(-z), z = d^2 / delta, errs by at most 2 sqrt(z) exp(-z) 8 eps / sqrt(delta) <= 0.86 * 8 eps *
// 31.7 = 2.6e-5; max_alpha_error, 1e-6, comes on top. In double the same is 5e-14, and nothing is
// dropped; d^2 cancels a few more digits where z is large and exp(-z) is not small: 1e-12.
template <class T>
Result<Finding> Alpha(const CheckContext& context) {
  TILEGRAD_ASSIGN(auto frame, RenderTriangle<T>(context.workers));
  context.Take("alpha", frame.alpha);
  std::vector<double> want;
  for (std::size_t i = 0; i < kPixels; ++i) {
    const double d = Distance(Pixel(i));
    want.push_back(Inside(Pixel(i)) ? 1 : std::exp(-d * d / kDelta));
  }
  Gauge gauge;
  TILEGRAD_TRY(gauge.Expect("alpha", frame.alpha, want, std::is_same_v<T, float> ? 2.7e-5 : 1e-12));
  return gauge.Found();
}

struct SeenColors {
  std::vector<double> color, depth;  // planar [3,H,W] and [H,W]
};

// Numbers that are linear in space are quotients of linear functions on the screen.
SeenColors SeenInPerspective() {
  SeenColors out{std::vector<double>(3 * kPixels), std::vector<double>(kPixels, INFINITY)};
  for (std::size_t i = 0; i < kPixels; ++i) {
    if (!Inside(Pixel(i))) continue;
    auto weights = ScreenWeights(Pixel(i));
    double sum = 0;
    for (std::size_t k = 0; k < 3; ++k) sum += weights[k] /= -kCorners[k][2];
    out.depth[i] = 1 / sum;
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t k = 0; k < 3; ++k) {
        out.color[c * kPixels + i] += weights[k] / sum * kColors[k][c];
      }
    }
  }
  return out;
}

// In float, weights err by 4 eps W / h, h = 22 pixels the height of the triangle: 1.4e-6, and by
// 1e-5 for the few operations on weights that, seen from a tile's corner, may be up to 64 in size.
// A colour in [0, 1] mixes three of them: 4 times that. So does 1/depth.
template <class T>
Result<Finding> ColorAndDepth(const CheckContext& context) {
  TILEGRAD_ASSIGN(auto frame, RenderTriangle<T>(context.workers));
  context.Take("color", frame.color);
  context.Take("depth", frame.depth);
  const SeenColors want = SeenInPerspective();
  const double allowed = std::is_same_v<T, float> ? 4.6e-5 : 1e-13;
  Gauge gauge;
  TILEGRAD_TRY(gauge.Expect("color", frame.color, want.color, allowed));
  TILEGRAD_TRY(gauge.ExpectOfLargest("depth", frame.depth, want.depth, allowed));
  return gauge.Found();
}

}  // namespace

std::vector<Check> TriangleChecks() {
  return {OnEveryTarget({"coverage of a triangle, float32", Coverage<float>}),
          OnEveryTarget({"alpha of a triangle, float32", Alpha<float>}),
          OnEveryTarget({"colour and depth of a triangle, float32", ColorAndDepth<float>}),
          {"coverage of a triangle, float64", Coverage<double>},
          {"alpha of a triangle, float64", Alpha<double>},
          {"colour and depth of a triangle, float64", ColorAndDepth<double>}};
}

}  // namespace tilegrad::selftest
