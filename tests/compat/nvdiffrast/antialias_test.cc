// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/antialias.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "compat/nvdiffrast/face_steps.h"
#include "compat/nvdiffrast/face_steps_ref.h"
#include "compat/nvdiffrast/test_util.h"
#include "support/expect.h"

namespace tilegrad::compat::nvdiffrast::antialias_test {

template <class T>
AntialiasInput<T> InputOf(const Scene<T>& scene, const EdgeRings& rings, const Numbers<T>& rast,
                          const Numbers<T>& color, std::size_t channels) {
  return {{scene.positions, scene.vertices(), 4, scene.shared},
          scene.faces,
          &rings,
          scene.grid(),
          rast,
          color,
          channels};
}

template <class T>
Numbers<T> Antialiased(const AntialiasInput<T>& input, const Workers& workers = Workers(1)) {
  Numbers<T> out(input.color.size(), T(-7));
  Ok(Antialias<T>(input, workers, out));
  return out;
}

// A quad whose sides are at the given places, in pixels of an image of 8 x 8.
Scene<double> Rectangle(double left, double right, double bottom, double top) {
  const auto at = [](double pixels) { return pixels / 4 - 1; };
  Scene<double> out;
  out.positions = {at(left),  at(bottom), 0, 1, at(right), at(bottom), 0, 1,
                   at(right), at(top),    0, 1, at(left),  at(top),    0, 1};
  out.faces = {0, 1, 2, 0, 2, 3};
  return out;
}

// 1 where something is seen.
Numbers<double> Coverage(const Numbers<double>& rast) {
  Numbers<double> out;
  for (std::size_t i = 3; i < rast.size(); i += 4) out.push_back(rast[i] > 0);
  return out;
}

// With the scene's own edges, colours of one channel.
Numbers<double> Antialiased(const Scene<double>& scene, const Numbers<double>& rast,
                            const Numbers<double>& color) {
  const EdgeRings rings = BuildEdgeRings(scene.faces);
  return Antialiased(InputOf(scene, rings, rast, color, 1));
}

TEST(EdgeRings, GoAroundTheSidesOfEachEdge) {
  // Two faces share (0, 2); three share (4, 5).
  const std::vector<std::int32_t> faces = {0, 1, 2, 2, 3, 0, 4, 5, 6, 5, 4, 7, 8, 4, 5};
  const EdgeRings rings = BuildEdgeRings(faces);
  EXPECT_EQ(rings.next[2], 5);
  EXPECT_EQ(rings.next[5], 2);
  EXPECT_EQ(rings.next[0], 0);
  EXPECT_EQ(rings.next[6], 9);
  EXPECT_EQ(rings.next[9], 13);
  EXPECT_EQ(rings.next[13], 6);
}

TEST(Antialias, SidesOfARectangleGetTheirShareOfThePixel) {
  // Columns 2 to 5 and rows 2 to 5 are seen. Of column 1, 0.2 is covered; of column 6, 0.1; row 2
  // lacks 0.4 below; row 5 reaches exactly to its upper border.
  const Scene<double> scene = Rectangle(1.8, 6.1, 2.4, 6.0);
  const auto rast = Rasterize(scene).rast;
  const auto color = Coverage(rast);
  const auto out = Antialiased(scene, rast, color);
  const auto at = [&](int x, int y) { return out[static_cast<std::size_t>(8 * y + x)]; };
  for (int y = 3; y < 5; ++y) {
    const double row[8] = {0, 0.2, 1, 1, 1, 1, 0.1, 0};
    for (int x = 0; x < 8; ++x) EXPECT_NEAR(at(x, y), row[x], 1e-12) << x << "," << y;
  }
  for (int x = 3; x < 5; ++x) {
    const double column[8] = {0, 0, 0.6, 1, 1, 1, 0, 0};
    for (int y = 0; y < 8; ++y) EXPECT_NEAR(at(x, y), column[y], 1e-12) << x << "," << y;
  }
}

TEST(Antialias, TheSumOfCoverageIsTheArea) {
  // Of a disc: edges at all angles. The rule is exact along straight edges at any angle but for
  // pixels at corners, of which there are 60, each off by less than 1/8.
  constexpr int kSides = 60;
  Scene<double> scene;
  scene.height = scene.width = 100;
  scene.positions = {0.013, 0.021, 0, 1};
  double area = 0;
  for (int i = 0; i < kSides; ++i) {
    const double a = 2 * 3.14159265358979 * i / kSides;
    for (const double v : {0.013 + 0.7 * std::cos(a), 0.021 + 0.7 * std::sin(a), 0.0, 1.0}) {
      scene.positions.push_back(v);
    }
    scene.faces.insert(scene.faces.end(), {0, 1 + i, 1 + (i + 1) % kSides});
    area += 0.5 * 35 * 35 * std::sin(2 * 3.14159265358979 / kSides);
  }
  const auto rast = Rasterize(scene).rast;
  const auto color = Coverage(rast);
  const auto out = Antialiased(scene, rast, color);
  double sum = 0, before = 0;
  for (const double v : out) sum += v;
  for (const double v : color) before += v;
  EXPECT_NEAR(sum, area, 2.0) << "point-sampled: " << before;
}

// Two triangles meet at x = 4.3 and fill the image. Sharing vertices they are one surface; in a
// soup the left one ends there and reaches 0.3 into the pixels of column 4.
TEST(Antialias, InASoupEveryEdgeIsASilhouette) {
  const auto at = [](double x, double y) { return Numbers<double>{x / 4 - 1, y / 4 - 1, 0, 1}; };
  const Numbers<double> corners[] = {at(4.3, -9), at(4.3, 17), at(-20, 4), at(30, 4)};
  for (const bool soup : {false, true}) {
    Scene<double> scene;
    scene.faces = {0, 1, 2, 1, 0, 3};
    std::vector<std::int32_t> vertices = {0, 1, 2, 3};
    if (soup) vertices = std::exchange(scene.faces, {0, 1, 2, 3, 4, 5});
    for (const auto v : vertices) {
      const auto& corner = corners[v];
      scene.positions.insert(scene.positions.end(), corner.begin(), corner.end());
    }
    const auto rast = Rasterize(scene).rast;
    Numbers<double> color;
    for (std::size_t i = 3; i < rast.size(); i += 4) color.push_back(rast[i]);
    const auto out = Antialiased(scene, rast, color);
    for (std::size_t p = 0; p < 64; ++p) {
      const double expected = p % 8 < 4 ? 1 : p % 8 > 4 || !soup ? 2 : 2 - 0.3;
      EXPECT_NEAR(out[p], expected, 1e-12) << p;
    }
  }
}

// Faces that name a vertex twice lie on no side of their edges.
TEST(Antialias, FacesWithoutAreaHideNoEdge) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Scene<double> scene = WavyGrid(2, seed, 24, 24);
    const auto rast = Rasterize(scene).rast;
    const auto color = RandomNumbers<double>(scene.grid().pixels(), 2);
    const auto blend = [&] { return Antialiased(scene, rast, color); };
    const auto expected = blend();
    for (std::int32_t v = 0; v < 9; ++v) {
      for (std::int32_t w = 0; w < 9; ++w)
        scene.faces.insert(scene.faces.end(), {v, w, w, v, v, w});
    }
    EXPECT_EQ(blend(), expected) << seed;
  }
}

TEST(Antialias, EdgesInsideOfASurfaceAreLeftAlone) {
  const Scene<double> scene = WavyGrid(3, 1, 24, 24);
  const auto rast = Rasterize(scene).rast;
  const auto color = RandomNumbers<double>(scene.grid().pixels(), 2);
  const auto out = Antialiased(scene, rast, color);
  std::size_t changed = 0, inside = 0;
  for (int y = 1; y < 23; ++y) {
    for (int x = 1; x < 23; ++x) {
      const auto p = static_cast<std::size_t>(24 * y + x);
      bool surrounded = true;
      for (const std::size_t q : {p, p - 1, p + 1, p - 24, p + 24})
        surrounded &= rast[4 * q + 3] > 0;
      if (surrounded) {
        EXPECT_EQ(out[p], color[p]) << x << "," << y;
      }
      inside += surrounded;
      changed += out[p] != color[p];
    }
  }
  EXPECT_GT(inside, 100u);
  EXPECT_GT(changed, 30u);
}

TEST(Antialias, AFoldIsASilhouetteBeforeAnotherSurface) {
  // Two faces share the edge x = 3.3 pixels and both lie to its right, one behind the other; the
  // background plane is farther away.
  const double x = 3.3 / 4 - 1;
  Scene<double> scene;
  scene.positions = {x, -1, -0.5, 1,  x,   1, -0.5, 1,  9,   0, -0.5, 1,  9,   0,
                     0, 1,  -9,   -9, 0.5, 1, 20,   -9, 0.5, 1, -9,   20, 0.5, 1};
  scene.faces = {0, 2, 1, 0, 1, 3, 4, 5, 6};
  const auto rast = Rasterize(scene).rast;
  Numbers<double> color;
  for (std::size_t i = 3; i < rast.size(); i += 4) color.push_back(rast[i] == 3 ? 10 : 20);
  const auto out = Antialiased(scene, rast, color);
  // Column 3, centre 3.5, shows the face and lacks 0.3.
  EXPECT_NEAR(out[8 * 4 + 3], 20 - 0.3 * 10, 1e-12);
  EXPECT_NEAR(out[8 * 4 + 2], 10, 1e-12);
}

// Float reads ids by vectors, double pixel by pixel, and a colour is blended in the type of the
// images; three bands, rows that do not fill the words of FindSteps.
TEST(Antialias, FloatIsTheReferenceForAnyNumberOfWorkers) {
  std::size_t blended = 0;
  for (const int width : {1, 5, 64, 65, 201}) {
    Scene<double> soup = WavyGrid(5, 3, 150, width);
    AddSoup(20, 4, &soup);
    const Scene<float> scene = AsScene<float>(soup);
    Scene<double> wide = soup;
    wide.positions = As<double>(scene.positions);
    const auto rast = Rasterize(scene).rast;
    const auto color = RandomNumbers<float>(3 * scene.grid().pixels(), 2);
    const auto d_out = RandomNumbers<float>(color.size(), 3);
    const EdgeRings rings = BuildEdgeRings(scene.faces);
    const auto rast64 = As<double>(rast);
    const auto color64 = As<double>(color);
    const auto input = InputOf(scene, rings, rast, color, 3);
    const auto expected = Antialiased(InputOf(wide, rings, rast64, color64, 3));
    for (std::size_t i = 0; i < color.size(); ++i) blended += expected[i] != color64[i];
    std::optional<Numbers<float>> first, first_color, first_positions;
    for (const std::string target : EveryTarget()) {
      for (const int count : {1, 3}) {
        const Workers workers(count);
        const auto out = Antialiased(input, workers);
        // A pixel takes part in four pairs, each of weight 1/2 at most: twenty roundings.
        ExpectWithin("out", out, expected, [](std::size_t) { return 24 * kRounding; });
        Numbers<float> d_color(color.size()), d_positions(scene.positions.size());
        Ok(AntialiasBackward<float>(input, d_out, workers, {d_color, d_positions}));
        if (!first) {
          first = out;
          first_color = d_color;
          first_positions = d_positions;
        }
        EXPECT_EQ(out, *first) << target << " " << count;
        EXPECT_EQ(d_color, *first_color) << target << " " << count;
        EXPECT_EQ(d_positions, *first_positions) << target << " " << count;
      }
    }
  }
  EXPECT_GT(blended, 1000u);
}

TEST(Antialias, NamesTheFirstPixelWhoseFaceDoesNotExist) {
  const Scene<float> scene = AsScene<float>(WavyGrid(2, 9, 100, 27));
  const EdgeRings rings = BuildEdgeRings(scene.faces);
  const Numbers<float> color(scene.grid().pixels());
  for (const float id : {-1.0f, 9.0f, 0.5f, std::nanf(""), 3e9f}) {
    for (const std::size_t pixel : {0u, 26u, 1728u, 2699u}) {  // 1728: the first of a band
      auto rast = Rasterize(scene).rast;
      rast.back() = -3;
      rast[4 * pixel + 3] = id;
      Numbers<float> out(color.size());
      ExpectMessage(Antialias<float>(InputOf(scene, rings, rast, color, 1), Workers(1), out),
                    "pixel " + std::to_string(pixel) + " of rast");
    }
  }
}

TEST(Antialias, AnEdgeThatPassesTheEyeIsFollowed) {
  // One end of the edge x = 0.3 is behind the eye.
  Scene<double> scene;
  scene.positions = {0.3, -0.9, 0, 1, -0.9, 9, 0, -3, -9, -1, 0, 1};
  scene.faces = {0, 1, 2};
  scene.height = scene.width = 20;
  const auto rast = Rasterize(scene).rast;
  const auto color = Coverage(rast);
  const auto out = Antialiased(scene, rast, color);
  // x/w = 0.3 is column 13, of which it covers nothing, at its left border.
  std::size_t checked = 0;
  for (std::size_t y = 0; y < 20; ++y) {
    if (color[20 * y + 12] == 0) continue;
    EXPECT_NEAR(out[20 * y + 12], 1, 1e-12);
    EXPECT_NEAR(out[20 * y + 13], 0, 1e-12);
    ++checked;
  }
  EXPECT_GT(checked, 3u);
}

// Where one face borders on another, from which antialiasing starts.

constexpr std::size_t kFaces = 5;

// A row of rast with runs of faces, of which some do not exist if `broken`.
Numbers<float> RowOf(std::size_t width, std::uint64_t seed, bool broken) {
  constexpr float kBad[] = {-1, 6, 0.5f, 4e9f, -4e9f};
  Rng rng(seed, 1);
  Numbers<float> out = RandomNumbers<float>(4 * width, seed);
  float id = 0;
  for (std::size_t x = 0; x < width; ++x) {
    if (rng.Uniform() < 0.3) id = std::floor(static_cast<float>(rng.Uniform(0, kFaces + 1)));
    const bool bad = broken && rng.Uniform() < 0.05;
    out[4 * x + 3] = bad ? kBad[static_cast<std::size_t>(rng.Uniform(0, 5))] : id;
  }
  return out;
}

TEST(FaceSteps, EveryTargetIsTheReference) {
  std::size_t bad = 0, steps = 0;
  for (std::size_t width = 1; width < 200; ++width) {
    const auto low = RowOf(width, width, width % 2 == 0), high = RowOf(width, width + 1000, false);
    FaceRow row(width), above(width);
    const std::size_t first = ReadFaceRowRef<float>(low, kFaces, &row);
    ReadFaceRowRef<float>(high, kFaces, &above);
    std::vector<std::uint64_t> expected((width + kStepBits - 1) / kStepBits);
    FindStepsRef(row, above, width, expected);
    for (const std::string target : EveryTarget()) {
      SCOPED_TRACE(target);
      FaceRow got(width), got_above(width);
      EXPECT_EQ(ReadFaceRow(low, kFaces, &got), first) << width;
      EXPECT_EQ(ReadFaceRow(high, kFaces, &got_above), kNoPixel) << width;
      EXPECT_EQ(got.ids, row.ids) << width;
      std::vector<std::uint64_t> bits(expected.size(), ~std::uint64_t{0});
      FindSteps(got, got_above, width, bits);
      EXPECT_EQ(bits, expected) << width;
    }
    bad += first != kNoPixel;
    for (const std::uint64_t word : expected) steps += word != 0;
  }
  EXPECT_GT(bad, 50u);
  EXPECT_GT(steps, 100u);
}

}  // namespace tilegrad::compat::nvdiffrast::antialias_test
