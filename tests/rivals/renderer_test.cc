// SPDX-License-Identifier: Apache-2.0
// Batches by the rivals: cameras and meshes to alpha and back, the same bits for any number of
// workers, no allocation in the steady state, and errors.
#include "rivals/renderer.h"

#include "rivals/test_util.h"
#include "scene/camera.h"
#include "scene/shapes.h"
#include "support/allocation_count.h"
#include "support/expect.h"

namespace tilegrad::rivals::renderer_test {

using namespace test;  // NOLINT: of the tests of one folder

constexpr std::size_t kMeshes = 2, kViews = 2, kImages = kMeshes * kViews;

// Two bumpy balls from two sides each.
template <class T>
struct Scene {
  Mesh ball;
  std::vector<T> positions, colors;  // no colours unless asked for
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
    return {positions, colors,  {ball.faces[0].data(), 3 * ball.faces.size()},
            cameras,   kMeshes, size};
  }
  Scene& Color() {
    Rng rng(6);
    colors = Random<T>(positions.size(), 0, 1, &rng);
    return *this;
  }
  std::size_t pixels() const { return kImages * Batch().pixels(); }
};

template <class T>
struct Images {
  std::vector<T> alpha, color, d_positions, d_colors;

  explicit Images(const Scene<T>& scene)
      : alpha(scene.pixels(), T(7)),
        color(scene.colors.empty() ? 0 : 3 * scene.pixels(), T(7)),
        d_positions(scene.positions.size(), T(7)),
        d_colors(scene.colors.size(), T(7)) {}
  ImagesT<T> View() { return {alpha, color}; }
  GradientsT<T> Gradients() { return {d_positions, d_colors}; }
};

// Of `d`: alpha first, then colours as far as there are any.
template <class T>
ImagesT<const T> PushesOf(const Scene<T>& scene, const std::vector<T>& d) {
  const std::span<const T> all = d;
  return {all.first(scene.pixels()),
          scene.colors.empty() ? std::span<const T>() : all.subspan(scene.pixels())};
}
template <class T>
std::vector<T> RandomPushes(const Scene<T>& scene) {
  Rng rng(4);
  return Random<T>(scene.pixels() * (scene.colors.empty() ? 1 : 4), -1, 1, &rng);
}

template <class T>
Images<T> Render(const Scene<T>& scene, const Options& options, const std::vector<T>& d,
                 const Workers& workers) {
  Images<T> out(scene);
  RendererT<T> renderer(workers);
  Ok(renderer.Render(scene.Batch(), options, out.View()));
  Ok(renderer.Backward(scene.Batch(), options, PushesOf(scene, d), out.Gradients()));
  return out;
}

std::vector<Options> AllRules() {
  std::vector<Options> out(4);
  out[1].softras.distance = SoftDistance::kBarycentric;
  out[1].softras.sigma = 1e-2;
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
  scene.Color();
  Options options;
  options.softras.sigma = 1e-3;
  options.softras.exact_product = true;
  options.softras_colors.gamma = 1e-3;
  options.softras_colors.position_gradient = true;
  const auto d = RandomPushes(scene);
  const auto at = Render(scene, options, d, workers);
  RendererT<double> renderer(workers);
  Images<double> moved(scene);
  const auto loss_at = [&](double* number, double x) {
    const double before = std::exchange(*number, x);
    EXPECT_TRUE(renderer.Render(scene.Batch(), options, moved.View()).ok());
    *number = before;
    double sum = 0;
    for (std::size_t p = 0; p < d.size(); ++p) {
      const std::size_t pixels = moved.alpha.size();
      sum += d[p] * (p < pixels ? moved.alpha[p] : moved.color[p - pixels]);
    }
    return sum;
  };
  const double h = 1e-6;
  int off = 0, checked = 0;
  const auto check = [&](std::vector<double>& numbers, const std::vector<double>& gradient) {
    EXPECT_GT(Largest(gradient), 1);
    for (std::size_t i = 0; i < numbers.size(); i += 7, ++checked) {
      const double x = numbers[i];
      const double want = (loss_at(&numbers[i], x + h) - loss_at(&numbers[i], x - h)) / (2 * h);
      if (std::abs(gradient[i] - want) > 1e-6 * Largest(gradient)) ++off;
    }
  };
  check(scene.positions, at.d_positions);
  check(scene.colors, at.d_colors);
  EXPECT_LE(20 * off, checked);
}

// N3MR gives each face one colour, the mean of its corners.
TEST(RivalRenderer, ColorsOfFacesAreMeansOfTheirCorners) {
  const Workers workers(1);
  Scene<float> scene(1, 16);
  scene.colors.assign(scene.positions.size(), 0.0f);
  for (std::size_t i = 0; i < scene.colors.size(); i += 3) scene.colors[i] = 0.75f;  // red
  Options options;
  options.rule = Rule::kN3mr;
  options.n3mr.reduction = N3mrReduction::kNone;
  std::vector<float> d(4 * scene.pixels());
  std::fill(d.begin() + static_cast<std::ptrdiff_t>(scene.pixels()), d.end(), 1.0f);
  const auto got = Render(scene, options, d, workers);
  const std::size_t pixels = scene.Batch().pixels();
  const std::size_t middle = static_cast<std::size_t>(8 * scene.size + 8);
  EXPECT_NEAR(got.color[middle], 0.75, 1e-5);
  EXPECT_EQ(got.color[pixels + middle], 0);
  EXPECT_EQ(got.color[0], 0);  // background
  // Each covered pixel shares 1 among vertices, in every channel.
  double covered = 0, sum = 0;
  for (std::size_t n = 0; n < kImages; ++n) {
    for (std::size_t p = 0; p < pixels; ++p) covered += got.color[3 * n * pixels + p] > 0 ? 1 : 0;
  }
  for (const float g : got.d_colors) sum += g;
  EXPECT_NEAR(sum, 3 * covered, 1e-3 * covered);
  EXPECT_GT(covered, 100);
}

// As the kernels' own tests, through a camera whose rounding (1e-7) meets a slope of alpha of
// 1 / sqrt(sigma) = 100 at most; the sweep's slopes have their own tolerance.
TEST(RivalRenderer, FloatIsDouble) {
  const Workers workers(2);
  Scene<float> scene(2, 32);
  Scene<double> exact(2, 32);
  for (const bool color : {false, true}) {
    if (color) {
      scene.Color();
      exact.Color();
    }
    for (const Options& options : AllRules()) {
      const auto d = RandomPushes(scene);
      const auto got = Render(scene, options, d, workers);
      const auto want = Render(exact, options, std::vector<double>(d.begin(), d.end()), workers);
      EXPECT_LT(Difference(got.alpha, want.alpha), 1e-4);
      EXPECT_LE(Difference(got.color, want.color), 2e-3);
      EXPECT_LT(Difference(got.d_positions, want.d_positions), 1e-2 * Largest(want.d_positions));
      EXPECT_LE(Difference(got.d_colors, want.d_colors), 1e-2 * Largest(want.d_colors));
    }
  }
}

// Large enough for several bands of rows and parts of faces.
TEST(RivalRenderer, SameBitsForAnyNumberOfWorkers) {
  for (const bool color : {false, true}) {
    Scene<float> scene(3, color ? 70 : 130);
    if (color) scene.Color();
    const auto d = RandomPushes(scene);
    for (const Options& options : AllRules()) {
      const auto one = Render(scene, options, d, Workers(1));
      EXPECT_GT(Largest(one.d_positions), 0);
      for (const int count : {2, 5}) {
        const auto many = Render(scene, options, d, Workers(count));
        EXPECT_EQ(one.alpha, many.alpha);
        EXPECT_EQ(one.color, many.color);
        EXPECT_EQ(one.d_positions, many.d_positions);
        EXPECT_EQ(one.d_colors, many.d_colors);
      }
    }
  }
}

TEST(RivalRenderer, ASteadyStateAllocatesNothing) {
  const Workers workers(1);
  Scene<float> scene(2, 48);
  for (const bool color : {false, true}) {
    if (color) scene.Color();
    Images<float> out(scene);
    const auto d = RandomPushes(scene);
    for (const Options& options : AllRules()) {
      Renderer renderer(workers);
      const auto step = [&] {
        EXPECT_TRUE(renderer.Render(scene.Batch(), options, out.View()).ok());
        EXPECT_TRUE(
            renderer.Backward(scene.Batch(), options, PushesOf(scene, d), out.Gradients()).ok());
      };
      step();
      const long before = tilegrad::test::g_allocations;
      step();
      EXPECT_EQ(tilegrad::test::g_allocations - before, 0);
    }
  }
}

// A mesh at the camera, behind it and beyond: something comes out, and it is finite.
TEST(RivalRenderer, AnyPositionsGiveFiniteGradients) {
  for (const float shift : {1.7f, 2.2f, 5.0f, -500.0f}) {
    Scene<float> scene(1, 16);
    scene.Color();
    const Camera& camera = scene.cameras[0];  // its third axis leads to the camera
    for (std::size_t i = 0; i < scene.positions.size(); ++i)
      scene.positions[i] += shift * camera.rotation[6 + i % 3];
    scene.positions[0] = 2.2f * camera.rotation[6];  // in the camera's plane, within rounding
    const auto d = RandomPushes(scene);
    for (const Options& options : AllRules()) {
      const auto got = Render(scene, options, d, Workers(1));
      // Four weights of the bilinear reduction sum to 1 within two roundings.
      for (const float a : got.alpha) EXPECT_TRUE(a >= 0 && a <= 1 + 2.4e-7f) << a;
      for (const auto* all : {&got.color, &got.d_positions, &got.d_colors}) {
        for (const float g : *all) EXPECT_TRUE(std::isfinite(g)) << shift;
      }
    }
  }
}

TEST(RivalRenderer, ErrorsNameTheOptionThatIsOutOfRange) {
  const auto message = [](const auto& change) {
    Options options;
    change(options);
    return Validate(options).message();
  };
  EXPECT_EQ(message([](Options& o) { o.softras.sigma = 0; }),
            "SoftRas: sigma is 0, but must be positive and finite");
  EXPECT_EQ(message([](Options& o) { o.softras.dist_eps = 0.5; }),
            "SoftRas: dist_eps is 0.5, but must lie in (0, 0.5)");
  EXPECT_EQ(message([](Options& o) { o.softras_colors.gamma = NAN; }),
            "SoftRas: gamma is nan, but must be positive and finite");
  EXPECT_EQ(message([](Options& o) { o.n3mr.near_plane = 200; }),
            "N3MR: near 200 and far 100 must be 0 < near < far");
  EXPECT_EQ(message([](Options& o) { o.n3mr.eps = -1; }),
            "N3MR: eps is -1, but must be positive and finite");
  EXPECT_EQ(message([](Options& o) { o.n3mr_colors.resolution = 1; }),
            "N3MR: resolution is 1; must be 2 to 32");
}

TEST(RivalRenderer, ErrorsSayWhatDoesNotFit) {
  const Workers workers(1);
  const Scene<float> scene(0, 8);
  Renderer renderer(workers);
  std::vector<float> alpha(scene.pixels());
  const auto message = [&](BatchT<float> batch, const Options& options, std::size_t pixels) {
    return renderer.Render(batch, options, {std::span(alpha).first(pixels), {}}).message();
  };
  const auto expect = [&](const std::string& text, const std::string& part) {
    ExpectIn(text, part);
  };
  BatchT<float> batch = scene.Batch();
  expect(message(batch, {}, 8), "alpha has 8 numbers, expected 256");
  expect(message(batch, {.softras = {.sigma = 0}}, alpha.size()), "SoftRas: sigma is 0");
  batch.meshes = 3;
  expect(message(batch, {}, alpha.size()), "do not make 3 equal meshes");
  batch = scene.Batch();
  std::vector<std::int32_t> faces(batch.faces.begin(), batch.faces.end());
  faces[4] = 12;
  batch.faces = faces;
  expect(message(batch, {}, alpha.size()), "corner 1 of face 1 is vertex 12, but there are 12");
  batch = scene.Batch();
  batch.colors = std::span(alpha).first(3);
  expect(message(batch, {}, alpha.size()), "colors has 3 numbers, expected 72");
  batch.colors = scene.positions;
  expect(message(batch, {}, alpha.size()), "color has 0 numbers, expected 768");
  EXPECT_TRUE(renderer.Render(scene.Batch(), {}, {alpha, {}}).ok());
  std::vector<float> d_positions(5);
  const ImagesT<const float> pushes{alpha, {}};
  expect(renderer.Backward(scene.Batch(), {}, pushes, {d_positions, {}}).message(),
         "the gradient of positions has 5 numbers");
  d_positions.resize(scene.positions.size());
  expect(renderer.Backward(scene.Batch(), {}, {alpha, alpha}, {d_positions, {}}).message(),
         "the adjoint of color has 256 numbers, expected 0");
}

}  // namespace tilegrad::rivals::renderer_test
