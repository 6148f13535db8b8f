// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/interpolate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "compat/nvdiffrast/antialias.h"
#include "compat/nvdiffrast/test_util.h"
#include "support/expect.h"

namespace tilegrad::compat::nvdiffrast::interpolate_test {

template <class T>
struct Attributes {
  Numbers<T> values;
  std::size_t channels = 3;
  bool shared = false;
  std::vector<std::int32_t> diff = {2, 0};
};

template <class T>
InterpolateInput<T> InputOf(const Scene<T>& scene, const Attributes<T>& attributes,
                            const Rasterized<T>& rasterized) {
  return {{attributes.values, scene.vertices(), attributes.channels, attributes.shared},
          scene.faces,
          scene.grid(),
          rasterized.rast,
          rasterized.rast_db,
          attributes.diff};
}

template <class T>
struct Images {
  Numbers<T> out, out_da;
};

template <class T>
Images<T> Interpolated(const InterpolateInput<T>& input, const Workers& workers = Workers(1)) {
  Images<T> images;
  images.out.assign(input.grid.pixels() * input.attributes.channels, T(-7));
  images.out_da.assign(input.grid.pixels() * 2 * input.diff_attrs.size(), T(-7));
  Ok(Interpolate<T>(input, workers, {images.out, images.out_da}));
  return images;
}

Scene<double> TwoViews(int n = 3, int height = 12, int width = 15) {
  Scene<double> scene = WavyGrid(n, 1, height, width);
  const auto other = WavyGrid(n, 2, height, width).positions;
  scene.positions.insert(scene.positions.end(), other.begin(), other.end());
  scene.images = 2;
  return scene;
}

TEST(Interpolate, PixelDifferentialsAreDifferencesBetweenPixels) {
  // One face over the image: values a small step beside a pixel follow from a finer image.
  Scene<double> scene;
  scene.positions = {-3, -3, 0, 1, 9, -2, 0, 2, -2, 9, 0, 3};
  scene.faces = {0, 1, 2};
  scene.height = scene.width = 4;
  Scene<double> fine = scene;
  fine.height = fine.width = 4 * 101;
  Attributes<double> attributes;
  attributes.values = RandomNumbers<double>(9, 3);
  attributes.diff = {1};
  const auto coarse_rast = Rasterize(scene), fine_rast = Rasterize(fine);
  const auto coarse = Interpolated(InputOf(scene, attributes, coarse_rast));
  const auto many = Interpolated(InputOf(fine, attributes, fine_rast));
  const auto at = [&](int x, int y) {
    return many.out[static_cast<std::size_t>(3 * (y * fine.width + x) + 1)];
  };
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 4; ++x) {
      const int cx = 101 * x + 50, cy = 101 * y + 50;  // the same centre
      const double* da = &coarse.out_da[static_cast<std::size_t>(2 * (4 * y + x))];
      EXPECT_NEAR(da[0], (at(cx + 1, cy) - at(cx - 1, cy)) * 50.5, 1e-4);
      EXPECT_NEAR(da[1], (at(cx, cy + 1) - at(cx, cy - 1)) * 50.5, 1e-4);
    }
  }
}

// Everything that follows from attributes and cotangents.
template <class T>
struct Results {
  Numbers<T> out, out_da, d_attributes, d_rast, d_db;

  Results(const InterpolateInput<T>& input, const Numbers<T>& d_out, const Numbers<T>& d_da)
      : d_attributes(input.attributes.values.size(), T(-7)),
        d_rast(input.rast.size(), T(-7)),
        d_db(input.rast.size(), T(-7)) {
    const auto images = Interpolated(input);
    out = images.out;
    out_da = images.out_da;
    Ok(InterpolateBackward<T>(input, {d_out, d_da}, Workers(1), {d_attributes, d_rast, d_db}));
  }
};

// For each number of attributes: the sum of the absolute weights of the pixels that pull on it.
// d(out) by attributes is u, v, 1 - u - v, and d(out_da) the derivatives of those.
Numbers<double> PullsOn(const InterpolateInput<float>& input) {
  const std::size_t n = input.attributes.channels;
  Numbers<double> sums(input.attributes.values.size());
  for (std::size_t p = 0; p < input.grid.pixels(); ++p) {
    const float *rast = &input.rast[4 * p], *db = &input.rast_db[4 * p];
    if (rast[3] == 0) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      const double x = k == 0 ? db[0] : k == 1 ? db[2] : std::abs(db[0]) + std::abs(db[2]);
      const double y = k == 0 ? db[1] : k == 1 ? db[3] : std::abs(db[1]) + std::abs(db[3]);
      const auto face = static_cast<std::size_t>(rast[3]) - 1;
      const std::size_t row =
          input.attributes.row(p / input.grid.image(), input.faces[3 * face + k]);
      for (std::size_t c = 0; c < n; ++c) sums[row * n + c] += 1;
      for (const auto c : input.diff_attrs) {
        sums[row * n + static_cast<std::size_t>(c)] += std::abs(x) + std::abs(y);
      }
    }
  }
  return sums;
}

struct FloatCase {
  int grid;
  std::size_t channels;
  std::vector<std::int32_t> diff;
  bool shared;
};

// The double reference gets the same numbers; r is kRounding, attributes and cotangents are within
// [-1, 1], and so are u, v and w = 1 - u - v, which is off by 2 r.
//   out     w c and the three rounded products and sums: (2 + 3) r, and terms sum to 1 at most
//   out_da  differences of attributes, within [-2, 2], and two products and sums: 3 r |du| 2, ...
//   d_rast  sums of n such differences times cotangents: (n + 2) r 2 n; d_rast_db with 2 D likewise
//   d_attributes   up to 64 pixels are summed in float, then in double: (64 + 3) r of the sum of
//           absolute terms; 1 r more when the sum becomes a float
// each with one r more for what is of second order.
TEST(Interpolate, FloatIsTheReferenceUpToRounding) {
  for (const FloatCase& c :
       {FloatCase{1, 1, {}, true}, FloatCase{3, 1, {0}, false}, FloatCase{3, 2, {0, 1}, true},
        FloatCase{12, 3, {}, false}, FloatCase{3, 3, {0, 1, 2}, false},
        FloatCase{3, 3, {2, 0}, true}, FloatCase{1, 4, {0, 1, 2, 3}, false},
        FloatCase{3, 4, {1, 1, 0}, true}, FloatCase{3, 5, {4, 3}, false},
        FloatCase{3, 8, {0, 1, 2, 3, 4, 5, 6, 7}, true}, FloatCase{3, 11, {}, false}}) {
    SCOPED_TRACE(c.channels);
    const Scene<double> scene = TwoViews(c.grid, 70, 201);
    const Scene<float> scene32 = AsScene<float>(scene);
    const Rasterized<float> rast32 = Rasterize(scene32);
    const Rasterized<double> rast = {As<double>(rast32.rast), As<double>(rast32.rast_db)};
    const std::size_t rows = scene.vertices() * (c.shared ? 1 : 2);
    const Attributes<float> values32{RandomNumbers<float>(rows * c.channels, 4), c.channels,
                                     c.shared, c.diff};
    const Attributes<double> values{As<double>(values32.values), c.channels, c.shared, c.diff};
    const std::size_t pixels = scene.grid().pixels(), da = 2 * c.diff.size();
    const auto d_out = RandomNumbers<float>(pixels * c.channels, 5);
    const auto d_da = RandomNumbers<float>(pixels * da, 6);
    const auto input = InputOf(scene32, values32, rast32);
    const Results<double> want(InputOf(scene, values, rast), As<double>(d_out), As<double>(d_da));
    const auto pulls = PullsOn(input);
    const auto n = static_cast<double>(c.channels);
    const auto at_db = [&](std::size_t i) { return std::abs(double{rast32.rast_db[i]}); };
    for (const std::string target : EveryTarget()) {
      const Results<float> got(input, d_out, d_da);
      ExpectWithin("out", got.out, want.out, [](std::size_t) { return 6 * kRounding; });
      ExpectWithin("out_da", got.out_da, want.out_da, [&](std::size_t i) {
        const std::size_t p = 4 * (i / da), x = i % 2;
        return 8 * kRounding * (at_db(p + x) + at_db(p + 2 + x));
      });
      ExpectWithin("d_rast", got.d_rast, want.d_rast,
                   [&](std::size_t) { return (n + 3) * kRounding * 2 * n; });
      ExpectWithin("d_rast_db", got.d_db, want.d_db, [&](std::size_t) {
        return (static_cast<double>(da) + 3) * kRounding * 2 * static_cast<double>(da);
      });
      ExpectWithin("d_attributes", got.d_attributes, want.d_attributes,
                   [&](std::size_t i) { return 69 * kRounding * pulls[i]; });
    }
  }
}

}  // namespace tilegrad::compat::nvdiffrast::interpolate_test

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
  const Status status = Antialias<T>(input, workers, out);
  EXPECT_TRUE(status.ok()) << status.message();
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
  const EdgeRings rings = BuildEdgeRings(scene.faces);
  const auto out = Antialiased(InputOf(scene, rings, rast, color, 1));
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
  const EdgeRings rings = BuildEdgeRings(scene.faces);
  const auto out = Antialiased(InputOf(scene, rings, rast, color, 1));
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
    const EdgeRings rings = BuildEdgeRings(scene.faces);
    const auto out = Antialiased(InputOf(scene, rings, rast, color, 1));
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
    const auto blend = [&] {
      const EdgeRings rings = BuildEdgeRings(scene.faces);
      return Antialiased(InputOf(scene, rings, rast, color, 1));
    };
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
  const EdgeRings rings = BuildEdgeRings(scene.faces);
  const auto out = Antialiased(InputOf(scene, rings, rast, color, 1));
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
  // With corners of its own, every face is a silhouette on all sides.
  Scene<double> loose = scene;
  loose.positions.clear();
  for (std::size_t i = 0; i < scene.faces.size(); ++i) {
    const auto from = scene.positions.begin() + 4 * scene.faces[i];
    loose.positions.insert(loose.positions.end(), from, from + 4);
    loose.faces[i] = static_cast<std::int32_t>(i);
  }
  const EdgeRings own = BuildEdgeRings(loose.faces);
  const auto all = Antialiased(InputOf(loose, own, rast, color, 1));
  std::size_t more = 0;
  for (std::size_t p = 0; p < all.size(); ++p) more += all[p] != color[p];
  EXPECT_GT(more, changed + 50);
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
  const EdgeRings rings = BuildEdgeRings(scene.faces);
  const auto out = Antialiased(InputOf(scene, rings, rast, color, 1));
  // Column 3, centre 3.5, shows the face and lacks 0.3.
  EXPECT_NEAR(out[8 * 4 + 3], 20 - 0.3 * 10, 1e-12);
  EXPECT_NEAR(out[8 * 4 + 2], 10, 1e-12);
}

TEST(Antialias, AnEdgeThatPassesTheEyeIsFollowed) {
  // One end of the edge x = 0.3 is behind the eye.
  Scene<double> scene;
  scene.positions = {0.3, -0.9, 0, 1, -0.9, 9, 0, -3, -9, -1, 0, 1};
  scene.faces = {0, 1, 2};
  scene.height = scene.width = 20;
  const auto rast = Rasterize(scene).rast;
  const auto color = Coverage(rast);
  const EdgeRings rings = BuildEdgeRings(scene.faces);
  const auto out = Antialiased(InputOf(scene, rings, rast, color, 1));
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

}  // namespace tilegrad::compat::nvdiffrast::antialias_test
