// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/rasterize.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "compat/nvdiffrast/barycentrics_ref.h"
#include "compat/nvdiffrast/test_util.h"
#include "support/expect.h"

namespace tilegrad::compat::nvdiffrast::rasterize_test {

// Every face for every pixel, in homogeneous coordinates without clipping. Nothing where rounding
// decides: close to an edge, a clip plane or another face.
struct Truth {
  std::int32_t face;
  Barycentrics<double> at;
};

std::optional<Truth> TruthAt(const Scene<double>& scene, int x, int y) {
  constexpr double kClose = 2e-3;
  Truth best{-1, {}};
  best.at.depth = 2;
  bool sure = true;
  for (std::size_t f = 0; f < scene.faces.size() / 3; ++f) {
    ClipCorners<double> c;
    for (int k = 0; k < 3; ++k) {
      const double* p = &scene.positions[4 * static_cast<std::size_t>(scene.faces[3 * f + k])];
      c.x[k] = p[0];
      c.y[k] = p[1];
      c.z[k] = p[2];
      c.w[k] = p[3];
    }
    const auto b = BarycentricsAt(c, CentreOf(scene.grid(), x, y), SizeOf(scene.grid()));
    const double last = 1 - b.u - b.v;
    const double w = b.u * c.w[0] + b.v * c.w[1] + last * c.w[2];
    const double inside = std::min({b.u, b.v, last, w, 1 - b.depth, 1 + b.depth});
    // A weight changes by its slope over a pixel; coverage is decided at 1/1024 of one.
    const double slope =
        std::max({std::abs(b.du_dx), std::abs(b.du_dy), std::abs(b.dv_dx), std::abs(b.dv_dy), 1.0});
    if (!b.solid || (inside > -kClose * slope && inside < kClose * slope)) sure = false;
    if (inside <= 0) continue;
    if (std::abs(b.depth - best.at.depth) < kClose) sure = false;
    if (b.depth < best.at.depth) best = {static_cast<std::int32_t>(f), b};
  }
  return sure ? std::optional(best) : std::nullopt;
}

TEST(Rasterize, SoupAroundTheFrustumIsWhatRaysSee) {
  std::size_t seen = 0, clipped = 0;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const Scene<double> scene = Soup(1 + seed % 4, seed, 13, 17);
    const auto out = Rasterize(scene);
    for (int y = 0; y < scene.height; ++y) {
      for (int x = 0; x < scene.width; ++x) {
        const auto truth = TruthAt(scene, x, y);
        if (!truth.has_value()) continue;
        const double* pixel = &out.rast[static_cast<std::size_t>(4 * (scene.width * y + x))];
        ASSERT_EQ(pixel[3], truth->face + 1) << "seed " << seed << " pixel " << x << "," << y;
        if (truth->face < 0) continue;
        ++seen;
        for (int k = 0; k < 3; ++k) {
          clipped += scene.positions[static_cast<std::size_t>(12 * truth->face + 4 * k + 3)] < 0;
        }
        EXPECT_NEAR(pixel[0], truth->at.u, 1e-12);
        EXPECT_NEAR(pixel[1], truth->at.v, 1e-12);
        EXPECT_NEAR(pixel[2], truth->at.depth, 1e-12);
        const double* db = &out.rast_db[static_cast<std::size_t>(4 * (scene.width * y + x))];
        EXPECT_NEAR(db[0], truth->at.du_dx, 1e-12);
        EXPECT_NEAR(db[3], truth->at.dv_dy, 1e-12);
      }
    }
  }
  EXPECT_GT(seen, 1000u);
  EXPECT_GT(clipped, 300u);
}

TEST(Rasterize, ClippedQuadHasNoSeam) {
  // Two faces through the eye and far out of the image share their diagonal: a floor under it.
  Scene<double> scene;
  scene.positions = {-50, -1, 30, 30, 50, -1, 30, 30, 50, -1, -40, -40, -50, -1, -40, -40};
  for (std::size_t v = 0; v < 4; ++v) scene.positions[4 * v + 2] -= 0.2;
  scene.faces = {0, 1, 2, 0, 2, 3};
  scene.height = 50;
  scene.width = 70;
  const auto out = Rasterize(scene);
  for (int y = 0; y < scene.height; ++y) {
    const double at = CentreOf(scene.grid(), 0, y).y;
    for (int x = 0; x < scene.width; ++x) {
      const double* pixel = &out.rast[static_cast<std::size_t>(4 * (scene.width * y + x))];
      // The floor is y = -1, so at y/w = `at` it has w = -1 / at, up to w = 30.
      const bool floor = at < 0 && -1 / at < 29;
      const bool empty = at > 0 || -1 / at > 31;
      if (floor || empty) {
        EXPECT_EQ(pixel[3] > 0, floor) << x << "," << y;
      }
    }
  }
}

// Also of faces that are cut, by any of the planes, wherever they start and however they are wound;
// and then there is nothing to peel.
TEST(Rasterize, OfCoincidingFacesThatAreCutTheFirstIsSeen) {
  std::size_t seen = 0;
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    Scene<float> scene = AsScene<float>(Soup(1, seed, 40, 48));
    scene.faces = {0, 1, 2, 1, 2, 0, 0, 2, 1, 2, 1, 0};
    std::rotate(scene.faces.begin(), scene.faces.begin() + 3 * (seed % 4), scene.faces.end());
    Numbers<float> peeled(scene.grid().pixels(), std::numeric_limits<float>::infinity());
    const auto first = Rasterize(scene, Workers(1), &peeled);
    const auto second = Rasterize(scene, Workers(1), &peeled);
    for (std::size_t p = 3; p < first.rast.size(); p += 4) {
      ASSERT_LE(first.rast[p], 1) << "seed " << seed << " pixel " << p / 4;
      ASSERT_EQ(second.rast[p], 0) << "seed " << seed << " pixel " << p / 4;
      seen += first.rast[p] == 1;
    }
  }
  EXPECT_GT(seen, 50000u);
}

// Overlapping faces of any shape at one depth: a pixel shows the first of those that cover it,
// which is the one that it shows when drawn with the faces before it only.
TEST(Rasterize, OfFacesAtOneDepthTheFirstIsSeen) {
  Scene<float> scene;
  scene.height = scene.width = 64;
  Rng rng(7, 1);
  const auto w = static_cast<float>(rng.Uniform(0.5, 2)), z = 0.3f * w;
  Numbers<float> first(64 * 64);
  std::size_t behind = 0;
  for (std::int32_t f = 0; f < 12; ++f) {
    for (std::int32_t k = 0; k < 3; ++k) {
      const double x = rng.Uniform(-1.5, 1.5), y = rng.Uniform(-1.5, 1.5);
      for (const double v : {x, y}) scene.positions.push_back(static_cast<float>(v) * w);
      scene.positions.insert(scene.positions.end(), {z, w});
      scene.faces.push_back(3 * f + k);
    }
    Scene<float> alone = scene;
    alone.faces.assign(scene.faces.end() - 3, scene.faces.end());
    const auto all = Rasterize(scene).rast, of_face = Rasterize(alone).rast;
    for (std::size_t p = 0; p < first.size(); ++p) {
      const bool covers = of_face[4 * p + 3] != 0;
      behind += covers && first[p] != 0;
      if (covers && first[p] == 0) first[p] = static_cast<float>(f + 1);
      ASSERT_EQ(all[4 * p + 3], first[p]) << f << " pixel " << p;
    }
  }
  EXPECT_GT(behind, 1000u);
}

TEST(Rasterize, LayersPeelFromFrontToBack) {
  Scene<float> scene;
  scene.height = scene.width = 70;  // more than one bin, and a face that covers all of a bin
  const float depths[3] = {0.5f, -0.5f, 0.0f};
  for (const float z : depths) {
    for (const float v : {-3.0f, -3.0f, z, 1.0f, 9.0f, -3.0f, z, 1.0f, -3.0f, 9.0f, z, 1.0f}) {
      scene.positions.push_back(v);
    }
  }
  for (std::int32_t i = 0; i < 9; ++i) scene.faces.push_back(i);
  Numbers<float> peeled(scene.grid().pixels(), std::numeric_limits<float>::infinity());
  for (const float expected : {2.0f, 3.0f, 1.0f, 0.0f, 0.0f}) {
    const auto out = Rasterize(scene, Workers(1), &peeled);
    for (std::size_t p = 0; p < scene.grid().pixels(); ++p) {
      ASSERT_EQ(out.rast[4 * p + 3], expected) << p;
    }
  }
}

TEST(Rasterize, SameBitsForEveryTargetAndNumberOfWorkers) {
  Scene<double> scene = WavyGrid(9, 5, 150, 90);
  AddSoup(30, 8, &scene);
  const Scene<float> narrow = AsScene<float>(scene);
  const auto expected = Rasterize(narrow);
  const auto d_rast = RandomNumbers<float>(expected.rast.size(), 1);
  const auto d_db = RandomNumbers<float>(expected.rast.size(), 2);
  std::optional<Numbers<float>> gradient;
  for (const std::string target : EveryTarget()) {
    for (const int count : {1, 2, 7}) {
      const Workers workers(count);
      const auto out = Rasterize(narrow, workers);
      EXPECT_EQ(out.rast, expected.rast) << target << " " << count;
      EXPECT_EQ(out.rast_db, expected.rast_db) << target << " " << count;
      Numbers<float> d(narrow.positions.size());
      Ok(RasterizeBackward<float>(narrow.input(), {out.rast, d_rast, d_db}, workers, d));
      if (!gradient.has_value()) gradient = d;
      EXPECT_EQ(d, *gradient) << target << " " << count;
    }
  }
}

// The bits of a list of numbers; those of NaN differ from instruction set to instruction set.
std::vector<std::uint32_t> BitsOf(const Numbers<float>& numbers) {
  std::vector<std::uint32_t> bits;
  for (const float v : numbers) bits.push_back(std::isnan(v) ? 1 : std::bit_cast<std::uint32_t>(v));
  return bits;
}

// Float goes through vectors, double pixel by pixel; both compute in double. One band, so that sums
// are rounded once. Faces of any size, some of them edge-on or behind the eye, in every number of
// pixels that a vector may have left at the end of a row.
TEST(Rasterize, FloatIsDoubleRoundedBitByBit) {
  std::size_t seen = 0, pulled = 0;
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    const int height = 20 + static_cast<int>(seed), width = 60 + static_cast<int>(seed);
    Scene<double> soup = WavyGrid(8, seed, height, width);
    AddSoup(20, seed, &soup);
    const Scene<float> narrow = AsScene<float>(soup);
    Scene<double> wide = soup;
    wide.positions = As<double>(narrow.positions);
    const auto expected = Rasterize(wide);
    const auto d_rast = RandomNumbers<float>(expected.rast.size(), seed);
    auto d_db = RandomNumbers<float>(expected.rast.size(), seed + 100);
    // Pixels may name any face, wherever it is.
    auto rast = As<float>(expected.rast);
    for (std::size_t p = 0; p < rast.size() / 4; p += 7) {
      rast[4 * p + 3] = static_cast<float>(p % (soup.faces.size() / 3 + 1));
    }
    Numbers<double> pull(wide.positions.size());
    Ok(RasterizeBackward<double>(
        wide.input(), {As<double>(rast), As<double>(d_rast), As<double>(d_db)}, Workers(1), pull));
    for (const std::string target : EveryTarget()) {
      const auto out = Rasterize(narrow);
      EXPECT_EQ(BitsOf(out.rast), BitsOf(As<float>(expected.rast))) << target << " " << seed;
      EXPECT_EQ(BitsOf(out.rast_db), BitsOf(As<float>(expected.rast_db))) << target << " " << seed;
      Numbers<float> d(narrow.positions.size());
      Ok(RasterizeBackward<float>(narrow.input(), {rast, d_rast, d_db}, Workers(1), d));
      EXPECT_EQ(BitsOf(d), BitsOf(As<float>(pull))) << target << " " << seed;
    }
    for (std::size_t p = 3; p < rast.size(); p += 4) seen += rast[p] > 0;
    for (const double v : pull) pulled += v != 0;
  }
  EXPECT_GT(seen, 20000u);
  EXPECT_GT(pulled, 2000u);
}

TEST(RasterizeBackward, NamesTheFirstPixelWhoseFaceDoesNotExist) {
  const Scene<float> scene = AsScene<float>(WavyGrid(2, 9, 100, 27));
  for (const float id : {-1.0f, 9.0f, 0.5f, std::nanf(""), 3e9f, HUGE_VALF}) {
    for (const std::size_t pixel : {0u, 26u, 1000u, 2699u}) {
      auto rast = Rasterize(scene).rast;
      rast.back() = -3;
      rast[4 * pixel + 3] = id;
      Numbers<float> gradient(scene.positions.size(), 5.0f);
      const Status status =
          RasterizeBackward<float>(scene.input(), {rast, rast, rast}, Workers(1), gradient);
      ExpectMessage(status, "pixel " + std::to_string(pixel) + " of rast");
    }
  }
}

TEST(RasterizeBackward, StaysFiniteWhereWIsTiny) {
  Scene<float> scene = AsScene<float>(WavyGrid(2, 9, 40, 40));
  for (float& v : scene.positions) v *= 1e-37f;  // the same image, gradients of 1e38 and more
  const auto out = Rasterize(scene);
  const Numbers<float> ones(out.rast.size(), 100.0f);
  Numbers<float> gradient(scene.positions.size());
  Ok(RasterizeBackward<float>(scene.input(), {out.rast, ones, ones}, Workers(1), gradient));
  float largest = 0;
  for (const float d : gradient) {
    ASSERT_TRUE(std::isfinite(d));
    largest = std::max(largest, std::abs(d));
  }
  EXPECT_EQ(largest, std::numeric_limits<float>::max());
}

TEST(RasterizeBackward, EdgeOnFacesPullNothing) {
  Scene<double> scene;
  scene.positions = {-1, -1, 0, 1, 1, 1, 0, 1, 1 - 1e-9, 1, 0, 1};
  scene.faces = {0, 1, 2};
  const Numbers<double> rast(4 * scene.grid().pixels(), 1.0);  // says that the face is everywhere
  Numbers<double> gradient(scene.positions.size(), 1.0);
  Ok(RasterizeBackward<double>(scene.input(), {rast, rast, rast}, Workers(1), gradient));
  for (const double d : gradient) EXPECT_EQ(d, 0);
}

}  // namespace tilegrad::compat::nvdiffrast::rasterize_test
