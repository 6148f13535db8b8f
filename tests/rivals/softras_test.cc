// SPDX-License-Identifier: Apache-2.0
// SoftRas's silhouettes: numbers worked out by hand, independent numbers of the published kernels,
// gradients by complex step, and the vector code against the reference on every target.
#include "rivals/softras.h"

#include <complex>

#include "rivals/softras_color.h"
#include "rivals/softras_color_ref.h"
#include "rivals/softras_ref.h"
#include "rivals/test_util.h"
#include "support/expect.h"

namespace tilegrad::rivals::softras_test {

using namespace test;  // NOLINT: of the tests of one folder

using Complex = std::complex<double>;

SoftDistance DistanceOf(const std::string& name) {
  return name == "hard"          ? SoftDistance::kHard
         : name == "barycentric" ? SoftDistance::kBarycentric
                                 : SoftDistance::kEuclidean;
}

SoftRasOptions OptionsOf(const Json& scene, const Json& one) {
  SoftRasOptions options;
  options.distance = DistanceOf(one["dist_func"]);
  options.sigma = one["sigma"];
  options.dist_eps = one["dist_eps"];
  options.near_plane = scene["near"];
  options.far_plane = scene["far"];
  return options;
}

struct Result {
  std::vector<float> alpha, d_corners;
};

// Rows in three parts, faces in two.
Result Fast(const std::vector<float>& corners, int size, const SoftRasOptions& options,
            const std::vector<float>& d_alpha) {
  Result out{std::vector<float>(d_alpha.size()), std::vector<float>(corners.size(), 7.0f)};
  SoftRasImage image;
  SetUpSoftRas(corners, size, options, &image);
  for (const RowRange rows : {RowRange{0, size / 3}, {size / 3, size / 2}, {size / 2, size}})
    SoftRasForward(options, rows, &image, out.alpha);
  SoftRasPrepareBackward(options, d_alpha, &image);
  const std::size_t faces = corners.size() / kCornerNumbers;
  SoftRasBackward(options, image, 0, faces / 2, out.d_corners);
  SoftRasBackward(options, image, faces / 2, faces, out.d_corners);
  return out;
}

// Calls check(scene, case, corners, d_alpha, alpha, d_corners) for every image of the file.
template <class Check>
void ForSharedCases(const Json& file, const Check& check) {
  for (const Json& scene : file["scenes"]) {
    for (const Json& one : scene["cases"]) {
      for (std::size_t n = 0; n < scene["face_vertices"].size(); ++n) {
        SCOPED_TRACE(scene["name"].get<std::string>() + " " + one["dist_func"].get<std::string>() +
                     " " + one["sigma"].dump() + " " + one["dist_eps"].dump());
        check(scene, OptionsOf(scene, one), n, one);
      }
    }
  }
}

// 1e-10: both sides compute in double; the file's own independent version agrees to 2e-13.
TEST(SoftRas, ReferenceGivesTheNumbersOfThePublishedKernels) {
  TILEGRAD_VECTORS_OR_SKIP(file, "15_softras.json");
  int cases = 0;
  ForSharedCases(
      file, [&](const Json& scene, const SoftRasOptions& options, std::size_t n, const Json& one) {
        const int size = scene["image_size"];
        const auto corners = Numbers(scene["face_vertices"][n]);
        const auto d_alpha = Numbers(scene["upstream_alpha"][n]);
        std::vector<double> alpha(d_alpha.size()), d_corners(corners.size());
        SoftRasForwardRef<double>(corners, size, options, alpha);
        SoftRasBackwardRef<double>(corners, size, options, d_alpha, d_corners);
        const auto want = Numbers(one["grad_face_vertices_xy"][n]);
        EXPECT_LT(Difference(alpha, Numbers(one["alpha"][n])), 1e-10);
        EXPECT_LT(Difference(PlaneParts(d_corners), want), 1e-10 * std::max(1.0, Largest(want)));
        ++cases;
      });
  EXPECT_EQ(cases, 40);
}

// One face, x + y <= 0 in the square of side 2; one pixel, in the middle of its long edge: D = 1/2.
TEST(SoftRas, AnEdgeThroughAPixelIsOneHalf) {
  const std::vector<double> corners = {-1, -1, 2, 1, -1, 2, -1, 1, 2};
  std::vector<double> alpha(1);
  SoftRasForwardRef<double>(corners, 1, {}, alpha);
  EXPECT_NEAR(alpha[0], 0.5, 1e-15);
  // Twice the face: 1 - 1/4, and 1/2 as the mean of its D.
  std::vector<double> twice = corners;
  twice.insert(twice.end(), corners.begin(), corners.end());
  SoftRasForwardRef<double>(twice, 1, {}, alpha);
  EXPECT_NEAR(alpha[0], 0.75, 1e-15);
  SoftRasForwardRef<double>(twice, 1, {.alpha = SoftAlpha::kSum}, alpha);
  EXPECT_NEAR(alpha[0], 0.5, 1e-15);
  SoftRasForwardRef<double>(twice, 1, {.distance = SoftDistance::kHard}, alpha);
  EXPECT_EQ(alpha[0], 1);  // the edge belongs to the face
}

// The pixel at 0, a face whose vertical edge is at x = h: d = -h^2, D = sigmoid(-h^2 / sigma), and
// moving the edge by dx changes d by -2 h dx; each of its ends has half of it.
TEST(SoftRas, AFaceBesideAPixel) {
  const double h = 0.1, sigma = 0.02;
  const std::vector<double> corners = {h, 0.5, 2, h, -0.5, 2, 1, 0, 2}, d_alpha = {1};
  const SoftRasOptions options{.sigma = sigma};
  std::vector<double> alpha(1), d_corners(9);
  SoftRasForwardRef<double>(corners, 1, options, alpha);
  const double probability = 1 / (1 + std::exp(h * h / sigma));
  EXPECT_NEAR(alpha[0], probability, 1e-15);
  SoftRasBackwardRef<double>(corners, 1, options, d_alpha, d_corners);
  const double push = probability * (1 - probability) / sigma * -2 * h;
  const std::vector<double> want = {push / 2, 0, 0, push / 2, 0, 0, 0, 0, 0};
  EXPECT_LT(Difference(d_corners, want), 1e-14);
}

// The cut is part of the definition: beyond sqrt(T) there is nothing.
TEST(SoftRas, NothingBeyondTheCutoff) {
  const SoftRasOptions options{.sigma = 0.01, .dist_eps = 1e-4};
  const double reach = std::sqrt(options.Cutoff());
  for (const double off : {-1e-6, 1e-6}) {
    const double h = reach + off;
    std::vector<double> alpha(1);
    SoftRasForwardRef<double>(std::vector<double>{h, 0.5, 2, h, -0.5, 2, 1, 0, 2}, 1, options,
                              alpha);
    EXPECT_NEAR(alpha[0], off < 0 ? 1e-4 : 0, 1e-8);
  }
}

struct Trial {
  const char* name;
  SoftRasOptions options;
};
const Trial kTrials[] = {
    {"euclidean", {.sigma = 1e-3, .exact_product = true}},
    {"euclidean sum", {.alpha = SoftAlpha::kSum, .sigma = 1e-3, .exact_product = true}},
    {"barycentric", {.distance = SoftDistance::kBarycentric, .sigma = 1e-2, .exact_product = true}},
    {"all repairs",
     {.sigma = 1e-3, .near_plane = 2.4, .exact_product = true, .gradient_beyond_planes = true}},
};

// Complex step: no subtraction, so both sides agree to rounding, 1e-16 times the largest term of
// the sums (1e3) and the pixels (256): 1e-10 leaves room. Published, faces beyond a plane count
// without gradient and the floor bends the rest: those trials use the repairs.
TEST(SoftRas, GradientsAreDerivatives) {
  constexpr int kSide = 16;
  for (const Trial& trial : kTrials) {
    SCOPED_TRACE(trial.name);
    Rng rng(5);
    const auto corners = RandomCorners<double>(12, 0.5, &rng);
    const auto d_alpha = Random<double>(kSide * kSide, -1, 1, &rng);
    std::vector<double> d_corners(corners.size());
    SoftRasBackwardRef<double>(corners, kSide, trial.options, d_alpha, d_corners);
    EXPECT_GT(Largest(d_corners), 0.1);
    std::vector<double> want(corners.size());
    for (std::size_t c = 0; c < corners.size(); ++c) {
      std::vector<Complex> moved(corners.begin(), corners.end());
      moved[c] += Complex(0, 1e-30);
      std::vector<Complex> alpha(d_alpha.size());
      SoftRasForwardRef<Complex>(moved, kSide, trial.options, alpha);
      for (std::size_t p = 0; p < alpha.size(); ++p)
        want[c] += d_alpha[p] * alpha[p].imag() / 1e-30;
    }
    EXPECT_LT(Difference(d_corners, want), 1e-10 * Largest(want));
  }
}

// Float against double. Alpha: d carries 2 sqrt(d) 1e-7, over sigma; at the cut-off of the smallest
// sigma here that is 2 * 0.05 * 1e-7 / 1e-4 = 1e-4 times D (1 - D) <= 1/4, for a few faces. Faces
// of the size of a pixel and above.
TEST(SoftRas, FloatIsTheReference) {
  constexpr int kSide = 37;
  std::vector<Trial> trials(std::begin(kTrials), std::end(kTrials));
  trials.push_back({"published", {}});
  trials.push_back({"hard", {.distance = SoftDistance::kHard}});
  trials.push_back({"near plane", {.sigma = 1e-3, .near_plane = 2.4}});
  trials.push_back({"hard alpha", {.alpha = SoftAlpha::kHard, .sigma = 1e-3}});
  for (const std::string target : EveryTarget()) {
    for (const Trial& trial : trials) {
      SCOPED_TRACE(target + std::string(", ") + trial.name);
      Rng rng(9);
      const auto corners = RandomCorners<float>(40, 0.3, &rng);
      const auto d_alpha = Random<float>(kSide * kSide, -1, 1, &rng);
      const Result got = Fast(corners, kSide, trial.options, d_alpha);
      const std::vector<double> exact(corners.begin(), corners.end());
      const std::vector<double> push(d_alpha.begin(), d_alpha.end());
      std::vector<double> alpha(d_alpha.size()), d_corners(corners.size());
      SoftRasForwardRef<double>(exact, kSide, trial.options, alpha);
      SoftRasBackwardRef<double>(exact, kSide, trial.options, push, d_corners);
      EXPECT_LT(Difference(got.alpha, alpha), 1e-4);
      EXPECT_LE(Difference(got.d_corners, d_corners), 1e-3 * Largest(d_corners));
    }
  }
}

// Faces that are no triangles on the image add nothing, and nothing becomes NaN.
TEST(SoftRas, OddFacesAreLeftOut) {
  constexpr int kSide = 9;
  Rng rng(2);
  const auto sound = RandomCorners<float>(3, 0.5, &rng);
  const auto d_alpha = Random<float>(kSide * kSide, -1, 1, &rng);
  const std::vector<float> all = WithOddFaces(sound);
  const Result alone = Fast(sound, kSide, {}, d_alpha), mixed = Fast(all, kSide, {}, d_alpha);
  EXPECT_EQ(alone.alpha, mixed.alpha);
  std::vector<float> want = alone.d_corners;
  want.resize(all.size(), 0.0f);
  EXPECT_EQ(mixed.d_corners, want);
}

// No face at all, in every rule.
TEST(SoftRas, AnEmptyImageIsEmpty) {
  for (const SoftAlpha rule : {SoftAlpha::kProduct, SoftAlpha::kSum, SoftAlpha::kHard}) {
    const Result got = Fast({}, 5, {.alpha = rule}, std::vector<float>(25, 1.0f));
    EXPECT_EQ(Largest(got.alpha), 0);
  }
}

}  // namespace tilegrad::rivals::softras_test

// SoftRas's colours: numbers worked out by hand, independent numbers of the published kernels, and
// gradients by complex step.

namespace tilegrad::rivals::softras_color_test {

using namespace test;  // NOLINT: of the tests of one folder

using Complex = std::complex<double>;

struct Gradients {
  std::vector<double> corners, textures;
};

Gradients Backward(const SoftRasScene<double>& scene, const std::vector<double>& d_color) {
  Gradients out{std::vector<double>(scene.corners.size()),
                std::vector<double>(scene.textures.size())};
  SoftRasColorBackwardRef<double>(scene, d_color, {out.corners, out.textures});
  return out;
}

struct FastImage {
  std::vector<float> color, d_corners, d_textures;
};

// The vector code: rows in three parts, faces in two.
FastImage Fast(const SoftRasScene<double>& scene, const std::vector<double>& d_color) {
  const std::vector<float> corners(scene.corners.begin(), scene.corners.end());
  const std::vector<float> textures(scene.textures.begin(), scene.textures.end());
  const std::vector<float> push(d_color.begin(), d_color.end());
  const int n = scene.size;
  FastImage out{std::vector<float>(push.size()), std::vector<float>(corners.size()),
                std::vector<float>(textures.size(), 7.0f)};
  SoftRasImage image;
  SoftRasColorImage mixed;
  SetUpSoftRas(corners, n, scene.options, &image);
  ReserveSoftRasColors(image, &mixed);
  const SoftRasColorJob job{scene.options, scene.colors, image, textures};
  for (const RowRange rows : {RowRange{0, n / 3}, {n / 3, n / 2}, {n / 2, n}})
    SoftRasColorForward(job, rows, &mixed, out.color);
  SoftRasColorPrepareBackward(image, push, &mixed);
  const SoftRasColorAdjoints adjoints{out.d_corners, out.d_textures};
  const std::size_t faces = scene.faces();
  SoftRasColorBackward(job, mixed, 0, faces / 2, adjoints);
  SoftRasColorBackward(job, mixed, faces / 2, faces, adjoints);
  return out;
}

// Against the reference. Depths of 2 to 9 round by 2^-22, over gamma (far - near) of 9e-4 at the
// least here: weights by 3e-4, colours by a quarter of that at most. Gradients have a factor of
// 1/gamma more to lose: 2e-3 of the largest entry. Where one face has all of the weight, C - I is
// rounding, 6e-8, times a slope of D of up to 1/sqrt(sigma), for some pixels.
void ExpectFastIsReference(const SoftRasScene<double>& scene, const std::vector<double>& d_color) {
  std::vector<double> color(d_color.size());
  SoftRasColorRef<double>(scene, color);
  const Gradients want = Backward(scene, d_color);
  for (const std::string target : EveryTarget()) {
    const FastImage got = Fast(scene, d_color);
    EXPECT_LT(Difference(got.color, color), 1e-4);
    EXPECT_LE(Difference(got.d_corners, want.corners),
              2e-3 * Largest(want.corners) + 1e-6 / std::sqrt(scene.options.sigma));
    EXPECT_LE(Difference(got.d_textures, want.textures), 1e-3 * Largest(want.textures));
  }
}

// A case of the file at one image.
struct SharedCase {
  std::vector<double> corners, textures, background, d_color, d_alpha;
  SoftRasScene<double> scene;

  SharedCase(const Json& of, const Json& one, std::size_t n)
      : corners(Numbers(of["face_vertices"][n])),
        textures(Numbers(of["textures"][one["texture"].get<std::string>()][n])),
        background(Numbers(of["background"])) {
    for (const std::size_t c : {0, 1, 2}) Flatten(of["upstream_rgba"][n][c], &d_color);
    Flatten(of["upstream_rgba"][n][3], &d_alpha);
    scene = {corners, textures, of["image_size"], softras_test::OptionsOf(of, one), {}};
    SoftRasColors& c = scene.colors;
    c.gamma = one["gamma"];
    std::copy_n(background.begin(), 3, c.background);
  }
};

// What the training's renderer can be asked for: colours of corners, mixed, from both sides.
bool IsOurs(const Json& one) {
  return one["texture_type"] == "vertex" && one["aggr_func_rgb"] != "hard" && one["double_side"];
}

// 1e-10: both sides compute in double; the file's independent version agrees to 1e-13.
TEST(SoftRasColors, ReferenceGivesTheNumbersOfThePublishedKernels) {
  TILEGRAD_VECTORS_OR_SKIP(file, "15b_softras_color.json");
  int cases = 0;
  for (const Json& of : file["scenes"]) {
    for (const Json& one : of["cases"]) {
      if (!IsOurs(one)) continue;
      for (std::size_t n = 0; n < of["face_vertices"].size(); ++n, ++cases) {
        SCOPED_TRACE(of["name"].get<std::string>() + " " + one["texture"].get<std::string>() +
                     " gamma " + one["gamma"].dump() + " sigma " + one["sigma"].dump());
        const SharedCase at(of, one, n);
        std::vector<double> color(at.d_color.size());
        SoftRasColorRef<double>(at.scene, color);
        EXPECT_LT(Difference(color, Numbers(one["rgb"][n])), 1e-10);
        Gradients got = Backward(at.scene, at.d_color);
        SoftRasBackwardRef<double>(at.corners, at.scene.size, at.scene.options, at.d_alpha,
                                   got.corners);
        const auto want = Numbers(one["grad_face_vertices"][n]);
        EXPECT_LT(Difference(got.corners, want), 1e-10 * std::max(1.0, Largest(want)));
        EXPECT_LT(Difference(got.textures, Numbers(one["grad_textures"][n])), 1e-10);
        ExpectFastIsReference(at.scene, at.d_color);
      }
    }
  }
  EXPECT_EQ(cases, 6);
}

// One face in front of a pixel, deep inside: D = 1. gamma = 1/2, near 1, far 3, z = 2: zn = 1/2.
TEST(SoftRasColors, AFaceBeforeTheBackground) {
  const std::vector<double> corners = {-9, -9, 2, 9, -9, 2, 0, 9, 2};
  const std::vector<double> textures = {1, 0, 0.5, 1, 0, 0.5, 1, 0, 0.5};
  SoftRasScene<double> scene{corners, textures, 1, {.near_plane = 1, .far_plane = 3}, {}};
  scene.colors = {.gamma = 0.5, .eps = 0.1, .background = {0, 1, 0.5}};
  std::vector<double> color(3);
  SoftRasColorRef<double>(scene, color);
  const double face = std::exp(1.0), background = std::exp(0.4);
  EXPECT_NEAR(color[0], face / (face + background), 1e-14);
  EXPECT_NEAR(color[1], background / (face + background), 1e-14);
  EXPECT_NEAR(color[2], 0.5, 1e-14);
}

// Without overflow, whatever gamma: the nearest face has all of the weight.
TEST(SoftRasColors, ASmallGammaTakesTheNearest) {
  std::vector<double> corners = {-9, -9, 3, 9, -9, 3, 0, 9, 3, -9, -9, 2, 9, -9, 2, 0, 9, 2};
  const std::vector<double> textures = {1, 1,    1, 1, 1,    1, 1, 1,    1,
                                        0, 0.25, 1, 0, 0.25, 1, 0, 0.25, 1};
  SoftRasScene<double> scene{corners, textures, 1, {}, {.gamma = 1e-7}};
  std::vector<double> color(3);
  SoftRasColorRef<double>(scene, color);
  EXPECT_LT(Difference(color, std::vector<double>{0, 0.25, 1}), 1e-14);
}

// Complex step; 1e-10 as for alpha. With the repair every gradient is a derivative; without it
// those of z and of textures.
TEST(SoftRasColors, GradientsAreDerivatives) {
  constexpr int kSide = 12;
  for (const bool repaired : {false, true}) {
    SCOPED_TRACE(repaired);
    Rng rng(7);
    SoftRasColors colors{.gamma = 0.02, .background = {0.2, 0.5, 0.7}};
    colors.position_gradient = repaired;
    const SoftRasOptions options{.sigma = 2e-3, .far_plane = 4};
    const auto corners = RandomCorners<double>(8, 0.6, &rng);
    const auto textures = Random<double>(8 * kSoftTexels * 3, 0, 1, &rng);
    const auto d_color = Random<double>(3 * kSide * kSide, -1, 1, &rng);
    const Gradients got = Backward({corners, textures, kSide, options, colors}, d_color);
    std::vector<double> all = corners, d_all = got.corners;
    all.insert(all.end(), textures.begin(), textures.end());
    d_all.insert(d_all.end(), got.textures.begin(), got.textures.end());
    double off = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      const bool moves_xy = i < corners.size() && i % 3 != 2;
      if (moves_xy && !repaired) continue;
      std::vector<Complex> moved(all.begin(), all.end());
      moved[i] += Complex(0, 1e-30);
      const std::span<const Complex> view = moved;
      std::vector<Complex> color(d_color.size());
      SoftRasColorRef<Complex>(
          {view.first(corners.size()), view.subspan(corners.size()), kSide, options, colors},
          color);
      double want = 0;
      for (std::size_t p = 0; p < color.size(); ++p) want += d_color[p] * color[p].imag() / 1e-30;
      off = std::max(off, std::abs(want - d_all[i]));
    }
    EXPECT_GT(Largest(got.textures), 0.1);
    EXPECT_LT(off, 1e-10 * std::max(1.0, Largest(d_all)));
  }
}

// Every rule, faces of the size of a few pixels, on every target.
TEST(SoftRasColors, FloatIsTheReference) {
  constexpr int kSide = 23;
  for (int trial = 0; trial < 4; ++trial) {
    SCOPED_TRACE(trial);
    Rng rng(11);
    SoftRasOptions options{.sigma = 1e-3, .far_plane = 4};
    SoftRasColors colors{.gamma = 1e-2, .background = {0.2, 0.5, 0.7}};
    colors.position_gradient = trial == 1;
    if (trial == 2) options.distance = SoftDistance::kHard;
    if (trial == 3) {
      options.distance = SoftDistance::kBarycentric;
      options.sigma = 1e-2;
    }
    const auto corners = RandomCorners<double>(30, 0.3, &rng);
    const auto textures = Random<double>(30 * kSoftTexels * 3, 0, 1, &rng);
    const auto d_color = Random<double>(3 * kSide * kSide, -1, 1, &rng);
    ExpectFastIsReference({corners, textures, kSide, options, colors}, d_color);
  }
}

}  // namespace tilegrad::rivals::softras_color_test
