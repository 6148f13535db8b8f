// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/interpolate.h"

#include <gtest/gtest.h>

#include <cmath>

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
