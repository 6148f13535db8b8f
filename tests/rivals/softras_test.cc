// SPDX-License-Identifier: Apache-2.0
// SoftRas's silhouettes: numbers worked out by hand, independent numbers of the published kernels,
// gradients by complex step, and the vector code against the reference on every target.
#include "rivals/softras.h"

#include <complex>

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
