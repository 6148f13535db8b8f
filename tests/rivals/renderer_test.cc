// SPDX-License-Identifier: Apache-2.0
// Batches by the rivals: cameras and meshes to alpha and back, the same bits for any number of
// workers, no allocation in the steady state, and errors.
#include "rivals/renderer.h"

#include "rivals/test_util.h"
#include "scene/camera.h"
#include "scene/shapes.h"
#include "support/allocation_count.h"

namespace tilegrad::rivals {
namespace {

using namespace test;  // NOLINT: of the tests of one folder

constexpr std::size_t kMeshes = 2, kViews = 2, kImages = kMeshes * kViews;

// Two bumpy balls from two sides each.
template <class T>
struct Scene {
  Mesh ball;
  std::vector<T> positions;
  std::vector<CameraT<T>> cameras;
  int size;

  Scene(int level, int side) : ball(Icosphere(level, 0.5f)), size(side) {
    Rng rng(3);
    for (std::size_t b = 0; b < kMeshes; ++b) {
      for (const glm::vec3& p : ball.positions) {
        const double bump = 0.9 + 0.2 * rng.Uniform();
        for (int c = 0; c < 3; ++c) positions.push_back(static_cast<T>(p[c] * bump));
      }
    }
    for (std::size_t n = 0; n < kImages; ++n) {
      const double azimuth = 25.0 + 90.0 * static_cast<double>(n);
      cameras.push_back(CameraCast<T>(OrbitCamera<double>({40, size, size}, azimuth, 15, 2.2)));
    }
  }
  BatchT<T> Batch() const {
    return {positions, {ball.faces[0].data(), 3 * ball.faces.size()}, cameras, kMeshes, size};
  }
  std::size_t pixels() const { return kImages * Batch().pixels(); }
};

template <class T>
struct Images {
  std::vector<T> alpha, d_positions;
};

template <class T>
Images<T> Render(const Scene<T>& scene, const Options& options, const std::vector<T>& d_alpha,
                 const Workers& workers) {
  Images<T> out{std::vector<T>(scene.pixels(), T(7)), std::vector<T>(scene.positions.size(), T(7))};
  RendererT<T> renderer(workers);
  const Status drawn = renderer.Render(scene.Batch(), options, out.alpha);
  EXPECT_TRUE(drawn.ok()) << drawn.message();
  const Status back = renderer.Backward(scene.Batch(), options, d_alpha, out.d_positions);
  EXPECT_TRUE(back.ok()) << back.message();
  return out;
}

std::vector<Options> AllRules() {
  std::vector<Options> out(4);
  out[1].softras.distance = SoftDistance::kBarycentric, out[1].softras.sigma = 1e-2;
  out[2].rule = out[3].rule = Rule::kN3mr;
  out[3].n3mr.reduction = N3mrReduction::kBilinear;
  return out;
}

// Central differences in double: truncation h^2 = 1e-12 times third derivatives of up to sigma^-3/2
// = 3e4; rounding 1e-16 / 1e-6 times a loss of tens. Both below 1e-7 of the largest entry, which is
// some tens. An entry in twenty may sit on a kink (a nearest edge that changes, the cut-off).
TEST(RivalRenderer, GradientsGoThroughTheCamera) {
  const Workers workers(1);
  Scene<double> scene(1, 16);
  Options options;
  options.softras.sigma = 1e-3, options.softras.exact_product = true;
  Rng rng(8);
  const auto d_alpha = Random<double>(scene.pixels(), -1, 1, &rng);
  const auto at = Render(scene, options, d_alpha, workers);
  RendererT<double> renderer(workers);
  std::vector<double> alpha(scene.pixels());
  const auto loss_at = [&](std::size_t i, double x) {
    const double before = std::exchange(scene.positions[i], x);
    EXPECT_TRUE(renderer.Render(scene.Batch(), options, alpha).ok());
    scene.positions[i] = before;
    double sum = 0;
    for (std::size_t p = 0; p < alpha.size(); ++p) sum += alpha[p] * d_alpha[p];
    return sum;
  };
  const double h = 1e-6, largest = Largest(at.d_positions);
  int off = 0, checked = 0;
  for (std::size_t i = 0; i < scene.positions.size(); i += 5, ++checked) {
    const double x = scene.positions[i];
    const double want = (loss_at(i, x + h) - loss_at(i, x - h)) / (2 * h);
    if (std::abs(at.d_positions[i] - want) > 1e-6 * largest) ++off;
  }
  EXPECT_GT(largest, 1);
  EXPECT_LE(20 * off, checked);
}

// As the kernels' own tests, through a camera whose rounding (1e-7) meets a slope of alpha of
// 1 / sqrt(sigma) = 100 at most; the sweep's slopes have their own tolerance.
TEST(RivalRenderer, FloatIsDouble) {
  const Workers workers(2);
  const Scene<float> scene(2, 32);
  const Scene<double> exact(2, 32);
  for (const Options& options : AllRules()) {
    Rng rng(4);
    const auto d_alpha = Random<float>(scene.pixels(), -1, 1, &rng);
    const auto got = Render(scene, options, d_alpha, workers);
    const auto want =
        Render(exact, options, std::vector<double>(d_alpha.begin(), d_alpha.end()), workers);
    EXPECT_LT(Difference(got.alpha, want.alpha), 1e-4);
    EXPECT_LT(Difference(got.d_positions, want.d_positions), 3e-3 * Largest(want.d_positions));
  }
}

// Large enough for several bands of rows and parts of faces.
TEST(RivalRenderer, SameBitsForAnyNumberOfWorkers) {
  const Scene<float> scene(3, 130);
  Rng rng(4);
  const auto d_alpha = Random<float>(scene.pixels(), -1, 1, &rng);
  for (const Options& options : AllRules()) {
    const auto one = Render(scene, options, d_alpha, Workers(1));
    EXPECT_GT(Largest(one.d_positions), 0);
    for (const int count : {2, 5}) {
      const auto many = Render(scene, options, d_alpha, Workers(count));
      EXPECT_EQ(one.alpha, many.alpha);
      EXPECT_EQ(one.d_positions, many.d_positions);
    }
  }
}

TEST(RivalRenderer, ASteadyStateAllocatesNothing) {
  const Workers workers(1);
  const Scene<float> scene(2, 48);
  Images<float> out{std::vector<float>(scene.pixels()), std::vector<float>(scene.positions.size())};
  const std::vector<float> d_alpha(scene.pixels(), -1.0f);
  for (const Options& options : AllRules()) {
    Renderer renderer(workers);
    const auto step = [&] {
      EXPECT_TRUE(renderer.Render(scene.Batch(), options, out.alpha).ok());
      EXPECT_TRUE(renderer.Backward(scene.Batch(), options, d_alpha, out.d_positions).ok());
    };
    step();
    const long before = tilegrad::test::g_allocations;
    step();
    EXPECT_EQ(tilegrad::test::g_allocations - before, 0);
  }
}

// A mesh at the camera, behind it and beyond: something comes out, and it is finite.
TEST(RivalRenderer, AnyPositionsGiveFiniteGradients) {
  for (const float shift : {1.7f, 2.2f, 5.0f, -500.0f}) {
    Scene<float> scene(1, 16);
    const Camera& camera = scene.cameras[0];  // its third axis leads to the camera
    for (std::size_t i = 0; i < scene.positions.size(); ++i)
      scene.positions[i] += shift * camera.rotation[6 + i % 3];
    scene.positions[0] = 2.2f * camera.rotation[6];  // in the camera's plane, within rounding
    const std::vector<float> d_alpha(scene.pixels(), -1.0f);
    for (const Options& options : AllRules()) {
      const auto got = Render(scene, options, d_alpha, Workers(1));
      // Four weights of the bilinear reduction sum to 1 within two roundings.
      for (const float a : got.alpha) EXPECT_TRUE(a >= 0 && a <= 1 + 2.4e-7f) << a;
      for (const float g : got.d_positions) EXPECT_TRUE(std::isfinite(g)) << shift;
    }
  }
}

TEST(RivalRenderer, ErrorsSayWhatDoesNotFit) {
  const Workers workers(1);
  const Scene<float> scene(0, 8);
  Renderer renderer(workers);
  std::vector<float> alpha(scene.pixels());
  const auto message = [&](BatchT<float> batch, const Options& options, std::size_t pixels) {
    return renderer.Render(batch, options, std::span(alpha).first(pixels)).message();
  };
  const auto expect = [&](const std::string& text, const std::string& part) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  BatchT<float> batch = scene.Batch();
  expect(message(batch, {}, 8), "alpha has 8 numbers, expected 256");
  batch.meshes = 3;
  expect(message(batch, {}, alpha.size()), "do not make 3 equal meshes");
  batch = scene.Batch();
  std::vector<std::int32_t> faces(batch.faces.begin(), batch.faces.end());
  faces[4] = 12;
  batch.faces = faces;
  expect(message(batch, {}, alpha.size()), "corner 1 of face 1 is vertex 12, but there are 12");
  Options options;
  options.softras.sigma = 0;
  expect(message(scene.Batch(), options, alpha.size()), "SoftRas: sigma is 0");
  options = {};
  options.softras.dist_eps = 0.5;
  expect(message(scene.Batch(), options, alpha.size()), "dist_eps is 0.5");
  options = {};
  options.n3mr.near_plane = 200;
  expect(message(scene.Batch(), options, alpha.size()), "N3MR: near 200 and far 100");
  options = {};
  options.n3mr.eps = -1;
  expect(message(scene.Batch(), options, alpha.size()), "N3MR: eps is -1");
  EXPECT_TRUE(renderer.Render(scene.Batch(), {}, alpha).ok());
  std::vector<float> d_positions(5);
  expect(renderer.Backward(scene.Batch(), {}, alpha, d_positions).message(),
         "the gradient of positions has 5 numbers");
}

}  // namespace
}  // namespace tilegrad::rivals
