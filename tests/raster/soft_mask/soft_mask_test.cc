// SPDX-License-Identifier: Apache-2.0
// The soft mask on every target against all faces in double, within E + the rounding that
// docs/numerics.md derives; gradients likewise. The reference itself by complex step:
// render/renderer_gradients_test.cc.
#include "raster/soft_mask/soft_mask.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <string>

#include "base/rng.h"
#include "raster/soft_mask/checks.h"
#include "raster/soft_mask/paper_ref.h"
#include "raster/soft_mask/plan.h"
#include "raster/soft_mask/test_util.h"
#include "support/expect.h"

namespace tilegrad::raster::soft_mask_test {

using test::CheckScene;
using test::RandomScene;
using test::RunSoftMask;
using test::SoftResult;
using test::SoftRun;
using test::SoftScene;
using test::SoftTruth;

void CheckScenes(std::uint64_t first, std::uint64_t count, std::size_t most_faces,
                 const SoftRun& run = {}) {
  SoftMaskScratch scratch;
  for (std::uint64_t seed = first; seed < first + count; ++seed) {
    SCOPED_TRACE("scene " + std::to_string(seed));
    CheckScene(RandomScene(seed, most_faces), &scratch, run);
    if (::testing::Test::HasFailure()) break;
  }
}

TEST(SoftMask, FewFacesOnEveryTarget) { CheckScenes(0, 1800, 12); }
TEST(SoftMask, ManyFacesOnEveryTarget) { CheckScenes(100000, 200, 150); }
// More than a chunk, and than a group of nodes: pixels may stop in between.
TEST(SoftMask, HundredsOfFacesOnEveryTarget) { CheckScenes(150000, 20, 900); }

// Faces that begin in a spot, more than a chunk of the way back, and around it four triangles so
// near to pixels that these are dark, though the spot, faint there, leaves much of their light.
// Points, or wedges, of which the pixels on the left see one corner.
SoftScene CrowdScene(std::uint64_t seed) {
  constexpr std::size_t kCrowd = 1800;
  Rng rng(seed, 79);
  SoftScene scene;
  scene.Resize(24, 24);
  scene.options.max_alpha_error = seed % 2 == 0 ? 1e-6 : 1e-4;
  scene.options.delta = 0.01;  // a kernel unit is a pixel
  for (std::size_t f = 0; f < kCrowd; ++f) {
    const auto x = static_cast<float>(rng.Uniform(11.3, 12.7));
    const auto y = static_cast<float>(rng.Uniform(11.3, 12.7));
    const float length = seed < 2 ? 0 : 2;
    scene.AddFace({x, x + length, x + length}, {y, y - length / 4, y + length / 4});
  }
  for (const float side : {7.43f, 16.57f}) {  // of pixels whose centres are 0.07 away
    const float beyond = side < 12 ? side - 3 : side + 3;
    scene.AddFace({side, side, beyond}, {6, 18, 12});
    scene.AddFace({6, 18, 12}, {side, side, beyond});
  }
  for (float& d : scene.d_alpha) d = static_cast<float>(rng.Uniform(-1, 1));
  return scene;
}

TEST(SoftMask, ACrowdAroundDarkPixelsOnEveryTarget) {
  SoftMaskScratch scratch;
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    SCOPED_TRACE(seed);
    CheckScene(CrowdScene(seed), &scratch);
  }
}

// Faces with two corners of some 10^-8 to 1, or one of about a half turn, whose sides rounding may
// confuse; background inside of them, too. A kernel unit is 0.05 to 5 pixels.
SoftScene NeedleScene(std::uint64_t seed) {
  Rng rng(seed, 81);
  SoftScene scene;
  scene.Resize(20, 20);
  scene.options.max_alpha_error = seed % 2 == 0 ? 0 : 1e-6;
  scene.options.delta = std::pow(10.0, rng.Uniform(-4.6, -0.6));
  for (int f = 0; f < 12; ++f) {
    const double ax = rng.Uniform(0, 20), ay = rng.Uniform(0, 20);
    const double tx = rng.Uniform(-9, 9), ty = rng.Uniform(-9, 9);
    const double along = rng.Uniform(-0.2, 1.2), aside = std::pow(10.0, rng.Uniform(-8, 0));
    const double x[3] = {ax, ax + tx, ax + along * tx - aside * ty};
    const double y[3] = {ay, ay + ty, ay + along * ty + aside * tx};
    const std::size_t k = rng.Below(3), step = 1 + rng.Below(2);  // any order
    float xs[3], ys[3];
    for (std::size_t i = 0; i < 3; ++i) {
      xs[i] = static_cast<float>(x[(k + i * step) % 3]);
      ys[i] = static_cast<float>(y[(k + i * step) % 3]);
    }
    scene.AddFace(xs, ys);
  }
  for (float& d : scene.d_alpha) d = static_cast<float>(rng.Uniform(-1, 1));
  return scene;
}

TEST(SoftMask, NeedlesOnEveryTarget) {
  SoftMaskScratch scratch;
  for (std::uint64_t seed = 0; seed < 400 && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    CheckScene(NeedleScene(seed), &scratch);
  }
}

TEST(SoftMask, WayBackFromAlphaAlone) {
  CheckScenes(400000, 600, 12, {.with_transmittance = false});
  CheckScenes(450000, 60, 150, {.with_transmittance = false});
}

// What it leaves and the rounding that is added to that are on either side of 1/64.
TEST(SoftMask, ALaneThatIsHardlyDarkIsNotLight) { CheckScenes(213605, 1, 12); }

TEST(SoftMaskLong, TwentyThousandScenes) {
  CheckScenes(200000, 18000, 12);
  CheckScenes(300000, 2000, 300);
}

// Groups of the tree of small faces in spots all over an image of several bins: most groups are far
// from a tile, some of them near its bin.
SoftScene SpotsScene(std::uint64_t seed) {
  Rng rng(seed, 78);
  SoftScene scene;
  scene.Resize(150, 100);
  scene.options.max_alpha_error = seed % 2 == 0 ? 1e-6 : 1e-2;
  scene.options.delta = std::pow(10.0, rng.Uniform(-5, -2));
  for (int spot = 0; spot < 20; ++spot) {
    const double cx = rng.Uniform(0, 150), cy = rng.Uniform(0, 100);
    for (std::size_t f = 0; f < kGroupFaces; ++f) {
      const auto at = [&](double c) { return static_cast<float>(c + rng.Uniform(-4, 4)); };
      scene.AddFace({at(cx), at(cx), at(cx)}, {at(cy), at(cy), at(cy)});
    }
  }
  for (float& d : scene.d_alpha) d = static_cast<float>(rng.Uniform(-1, 1));
  return scene;
}

// Tiles come in another order and reuse scratch with other leftovers. Gradients of a face are
// summed in that order: over some sixty tiles at most, each with an error of 2^-24 of the largest.
void CheckRegions(const SoftScene& scene, SoftMaskScratch* scratch) {
  const SoftResult bins = RunSoftMask(scene, scene.d_alpha, scratch);
  const SoftResult tiles = RunSoftMask(scene, scene.d_alpha, scratch, {.region_bits = kTileBits});
  EXPECT_EQ(bins.alpha, tiles.alpha);
  EXPECT_EQ(bins.spent, tiles.spent);
  float largest = 0;
  for (const float d : tiles.d_corners) largest = std::max(largest, std::abs(d));
  EXPECT_GT(largest, 0);
  for (std::size_t i = 0; i < tiles.d_corners.size(); ++i) {
    ASSERT_NEAR(bins.d_corners[i], tiles.d_corners[i], 60 * 0x1p-24 * largest) << i;
  }
}

TEST(SoftMask, RegionsDoNotMatterOnAnyTarget) {
  SoftMaskScratch scratch;
  for (const std::string target : EveryTarget()) {
    for (std::uint64_t seed = 0; seed < 12; ++seed) {
      SCOPED_TRACE(seed);
      CheckRegions(SpotsScene(seed), &scratch);
    }
  }
}

// What is behind the camera or has no place on the screen is no part of the mask, whatever else is
// said of the face.
TEST(SoftMask, RejectedFacesDoNotTakePart) {
  SoftMaskScratch scratch;
  for (const int reject : {+kFaceBehind, +kFaceOverflow, kFaceBehind | kFaceOverflow}) {
    SCOPED_TRACE(reject);
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      SoftScene scene = RandomScene(seed, 60);
      scene.options.max_alpha_error = 0;
      SoftScene others = scene;
      others.mesh.v0.clear();
      others.mesh.v1.clear();
      others.mesh.v2.clear();
      others.mesh.reject.clear();
      for (std::size_t f = 0; f < scene.mesh.reject.size(); ++f) {
        if (f % 3 == 1) {
          scene.mesh.reject[f] = static_cast<std::uint8_t>(reject);
          continue;
        }
        others.mesh.v0.push_back(scene.mesh.v0[f]);
        others.mesh.v1.push_back(scene.mesh.v1[f]);
        others.mesh.v2.push_back(scene.mesh.v2[f]);
        others.mesh.reject.push_back(kFaceDrawn);
      }
      others.options.faces = others.mesh.reject.size();
      const SoftTruth truth(others);
      const SoftResult a = RunSoftMask(scene, scene.d_alpha, &scratch);
      const SoftResult b = RunSoftMask(others, scene.d_alpha, &scratch);
      for (std::size_t i = 0; i < scene.pixels(); ++i) {
        ASSERT_NEAR(a.alpha[i], b.alpha[i], 2 * truth.Rounding(i) + 1e-30);
      }
    }
  }
}

// Far faces are dropped by groups and nodes without being looked at; what is reported covers them.
TEST(SoftMask, DroppedNodesAreBooked) {
  SoftScene scene;
  scene.Resize(16, 16);
  scene.options.max_alpha_error = 1e-2;
  for (const float x : {60.0f, 600.0f}) {
    for (int f = 0; f < 1000; ++f) scene.AddFace({x, x + 1, x}, {8, 8, 9});
  }
  SoftMaskScratch scratch;
  for (const double delta : {0.5, 1.0, 3.0, 10.0}) {
    scene.options.delta = delta;
    const SoftTruth at(scene);
    const SoftResult result = RunSoftMask(scene, scene.d_alpha, &scratch);
    EXPECT_LE(result.spent, scene.options.max_alpha_error);
    for (std::size_t i = 0; i < scene.pixels(); ++i) {
      EXPECT_NEAR(static_cast<double>(result.alpha[i]), at.Alpha(i), result.spent + at.Rounding(i));
    }
  }
}

// Thousands of faces, each too weak to change 1 - A in float, together are not.
TEST(SoftMask, FaintFacesAddUp) {
  SoftScene scene;
  scene.Resize(4, 4);
  scene.options.delta = 0.1;
  scene.options.max_alpha_error = 0;
  // z = d^2 / delta = 17.5, A = 2.5e-8 < 2^-25
  const auto x = static_cast<float>(0.5 + 2 * std::sqrt(1.75));
  for (int f = 0; f < 20000; ++f) scene.AddFace({x, x, x}, {0.5f, 0.5f, 0.5f});
  SoftMaskScratch scratch;
  const SoftTruth truth(scene);
  ASSERT_GT(truth.Alpha(0), 4e-4);
  EXPECT_NEAR(static_cast<double>(RunSoftMask(scene, scene.d_alpha, &scratch).alpha[0]),
              truth.Alpha(0), truth.Rounding(0));
}

// E = 1e-7 lets the way back drop each of them, but not so many: the gradient of all together lacks
// no more than 2 sqrt(z) 2^-17.
TEST(SoftMask, GradientsOfFaintFacesAddUp) {
  SoftScene scene;
  scene.Resize(4, 4);
  scene.options.delta = 0.1;
  scene.options.max_alpha_error = 1e-7;
  const auto x = static_cast<float>(0.5 + 2 * std::sqrt(1.8));  // A = 1.5e-8 < E/4
  for (int f = 0; f < 20000; ++f) scene.AddFace({x, x, x}, {0.5f, 0.5f, 0.5f});
  scene.d_alpha[0] = 1;
  std::vector<double> exact, tolerance;
  SoftTruth(scene).Gradient(scene.d_alpha, &exact, &tolerance);
  SoftMaskScratch scratch;
  const SoftResult result = RunSoftMask(scene, scene.d_alpha, &scratch);
  double sum = 0, truth = 0;
  for (std::size_t i = 0; i < exact.size(); i += 2) {
    sum += static_cast<double>(result.d_corners[i]);
    truth += exact[i];
  }
  const double unit = 0.5 / std::sqrt(scene.options.delta);  // of exp(-z), z = 18, per pixel
  EXPECT_GT(std::abs(truth), 3e-3);
  EXPECT_NEAR(sum, truth, 2 * std::sqrt(18.0) * unit * 0x1p-17);
}

// Beyond its reach a face has no more than a quarter of E and of what rounding takes from 1 - A,
// and all of a pixel have little; or else the forward pass drops it, too.
TEST(SoftMask, GradientsReachNoFartherThanTheyMatter) {
  for (const double e : {0.0, 1e-9, 1e-7, 1e-6, 1e-4, 1e-2}) {
    const SoftMaskPlan plan = PlanSoftMask({256, 256, 1e-4, e, 1000000});
    for (const std::size_t n : {1u, 20u, 700u, 100000u}) {
      const SoftReach alpha = ReachOf(plan, n), gradient = GradientReachOf(plan, n);
      EXPECT_LE(gradient.z, alpha.z);
      if (gradient.z == alpha.z) continue;
      EXPECT_LE(gradient.share, std::min(e / 4, 0x1p-25)) << e << ' ' << n;
      EXPECT_LE(gradient.share * static_cast<double>(n), 0x1p-17) << e << ' ' << n;
    }
  }
  const SoftMaskPlan plan = PlanSoftMask({256, 256, 1e-4, 1e-7, 1000000});
  EXPECT_LT(GradientReachOf(plan, 700).z, ReachOf(plan, 700).z - 6);
}

TEST(SoftMask, PixelOnTheBoundaryIsOpaqueAndStill) {
  SoftScene scene;
  scene.Resize(8, 8);
  scene.AddFace({1.5f, 6.5f, 1.5f}, {1.5f, 1.5f, 6.5f});
  scene.d_alpha.assign(64, 0.0f);
  for (const std::size_t on : {9u, 11u, 14u, 49u}) scene.d_alpha[on] = 1;
  SoftMaskScratch scratch;
  const SoftResult result = RunSoftMask(scene, scene.d_alpha, &scratch);
  EXPECT_EQ(result.alpha[9], 1.0f);
  EXPECT_EQ(result.alpha[11], 1.0f);
  for (const float d : result.d_corners) EXPECT_EQ(d, 0.0f);
}

// A saturated pixel: 1 - A is 0 in float for one face, and the other must not lose or gain.
TEST(SoftMask, GradientNearAnEdgeIsNotLost) {
  SoftScene scene;
  scene.Resize(4, 4);
  scene.options.delta = 1;
  scene.options.max_alpha_error = 0;
  scene.AddFace({-3, 9, 3}, {0.4999f, 0.4999f, -9});
  SoftMaskScratch scratch;
  std::vector<float> d_alpha(16, 0.0f);
  d_alpha[1] = 1;
  const SoftResult result = RunSoftMask(scene, d_alpha, &scratch);
  ASSERT_EQ(result.alpha[1], 1.0f);
  std::vector<double> exact, tolerance;
  SoftTruth(scene).Gradient(d_alpha, &exact, &tolerance);
  for (const std::size_t n : {1u, 3u}) {
    EXPECT_NE(exact[n], 0);
    EXPECT_NEAR(static_cast<double>(result.d_corners[n]) / exact[n], 1, 0.01);
  }
}

TEST(SoftMask, FiniteAtExtremes) {
  SoftMaskScratch scratch;
  const float coordinates[] = {0.0f, -0.0f, 1e-40f, 1e-20f, 2.5f, 1e6f, -1e12f, 1e30f, -3e38f};
  Rng rng(5);
  for (int n = 0; n < 3000; ++n) {
    SoftScene scene;
    scene.Resize(9, 5);
    scene.options.delta = std::pow(10.0, rng.Uniform(-300, 300));
    scene.options.max_alpha_error = rng.Below(2) == 0 ? 0 : rng.Uniform();
    for (int f = 0; f < 3; ++f) {
      float x[3], y[3];
      for (float& c : x) c = coordinates[rng.Below(9)];
      for (float& c : y) c = coordinates[rng.Below(9)];
      scene.AddFace(x, y);
    }
    const SoftResult result = RunSoftMask(scene, std::vector<float>(45, 1.0f), &scratch);
    for (const float a : result.alpha) EXPECT_TRUE(a >= 0 && a <= 1) << a;
    for (const float d : result.d_corners) EXPECT_FALSE(std::isnan(d));
    EXPECT_TRUE(result.spent >= 0 && result.spent <= 1);
  }
}

TEST(SoftMask, NoFacesAndNoBackground) {
  SoftScene scene;
  scene.Resize(3, 3);
  SoftMaskScratch scratch;
  for (const float a : RunSoftMask(scene, scene.d_alpha, &scratch).alpha) EXPECT_EQ(a, 0.0f);
  scene.face_ids.assign(9, 4);
  const SoftResult covered = RunSoftMask(scene, scene.d_alpha, &scratch);
  for (const float a : covered.alpha) EXPECT_EQ(a, 1.0f);
  EXPECT_EQ(covered.spent, 0);
}

// The paper's rule by hand and against a complex step. Golden numbers of a published
// implementation: tests/python/test_kaolin.py, GoldenSoftMask.

// At most as many faces as the box admits, in order: the second face cannot matter.
TEST(SoftMaskPaper, TakesTheFirstFacesOnly) {
  std::vector<NdcFace<double>> faces(2);
  faces[0] = {{0.10, 0.11, 0.10}, {0, 0, 0.01}};
  faces[1] = {{0.01, 0.02, 0.01}, {0, 0, 0.01}};
  PaperSoftMask rule;
  rule.box = 0.2;
  rule.max_faces = 1;
  EXPECT_NEAR(PaperAlphaRef<double>(faces, 0.0, 0.0, rule), std::exp(-7000 * 0.01), 1e-15);
  rule.max_faces = 2;
  EXPECT_NEAR(PaperAlphaRef<double>(faces, 0.0, 0.0, rule), std::exp(-7000 * 0.0001), 1e-9)
      << "eps is 1e-9 of the squared edge";
  rule.box = 0.005;
  EXPECT_EQ(PaperAlphaRef<double>(faces, 0.0, 0.0, rule), 0);
}

TEST(SoftMaskPaper, GradientIsThatOfAComplexStep) {
  using Complex = std::complex<double>;
  Rng rng(3);
  const PaperSoftMask rule{.inverse_delta = 70, .box = 0.3};
  for (int scene = 0; scene < 50; ++scene) {
    std::vector<NdcFace<double>> faces(4), d_faces(4);
    std::vector<NdcFace<Complex>> stepped(4);
    for (std::size_t f = 0; f < 4; ++f) {
      for (std::size_t k = 0; k < 3; ++k) {
        stepped[f].x[k] = faces[f].x[k] = rng.Uniform(-0.3, 0.3);
        stepped[f].y[k] = faces[f].y[k] = rng.Uniform(-0.3, 0.3);
      }
    }
    PaperAlphaRefBackward<double>(faces, 0.05, -0.02, rule, 1.0, d_faces);
    for (std::size_t f = 0; f < 4; ++f) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Complex x = stepped[f].x[k];
        stepped[f].x[k] += Complex(0, 1e-100);
        const Complex a = PaperAlphaRef<Complex>(stepped, Complex(0.05), Complex(-0.02), rule);
        stepped[f].x[k] = x;
        EXPECT_NEAR(d_faces[f].x[k], a.imag() * 1e100, 1e-11);
      }
    }
  }
}

// The pixel is in the box of a face whose boundary is farther away than `farthest`: A is that of
// `farthest`, and has no gradient.
TEST(SoftMaskPaper, FartherThanFarthest) {
  const std::vector<NdcFace<double>> faces = {{{-200, 200, 0}, {-150, -150, 250}}};
  const PaperSoftMask rule{.inverse_delta = 0.5};
  EXPECT_NEAR(PaperAlphaRef<double>(faces, 0, 0, rule), std::exp(-2.0), 1e-15);
  std::vector<NdcFace<double>> d_faces(1);
  PaperAlphaRefBackward<double>(faces, 0, 0, rule, 1, d_faces);
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(d_faces[0].x[k], 0);
    EXPECT_EQ(d_faces[0].y[k], 0);
  }
}

}  // namespace tilegrad::raster::soft_mask_test
