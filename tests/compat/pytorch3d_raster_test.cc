// SPDX-License-Identifier: Apache-2.0
// The K nearest faces of pixels: against every face for every pixel, sorted; errors. The gradient:
// test_fragments.py.
#include "compat/pytorch3d_raster.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <complex>
#include <limits>
#include <tuple>
#include <vector>

#include "base/rng.h"
#include "compat/pytorch3d_fragment.h"
#include "support/expect.h"

namespace tilegrad::compat::pytorch3d::layered_raster_test {

template <class T>
struct Layers {
  std::vector<std::int64_t> faces;
  std::vector<T> z, bary, dists;

  LayeredImages<T> View() { return {faces, z, bary, dists}; }
  explicit Layers(std::size_t n) : faces(n), z(n), bary(3 * n), dists(n) {}
  bool operator==(const Layers&) const = default;
};

template <class T>
std::vector<T> RandomFaces(std::size_t count, double size, Rng* rng) {
  std::vector<T> v;
  for (std::size_t f = 0; f < count; ++f) {
    const double x = rng->Uniform(-1.5, 1.5), y = rng->Uniform(-1.5, 1.5);
    for (int k = 0; k < 3; ++k) {
      v.push_back(static_cast<T>(x + rng->Uniform(-size, size)));
      v.push_back(static_cast<T>(y + rng->Uniform(-size, size)));
      // Some behind the camera, some of equal depth.
      v.push_back(static_cast<T>(f % 5 == 0 ? 2.0 : rng->Uniform(-0.1, 3)));
    }
  }
  return v;
}

std::size_t Count(const LayeredOptions& o, std::size_t images) {
  return images * static_cast<std::size_t>(o.size.width) * static_cast<std::size_t>(o.size.height) *
         static_cast<std::size_t>(o.faces_per_pixel);
}

template <class T>
Layers<T> Draw(const std::vector<T>& v, const std::vector<FaceRange>& images,
               const LayeredOptions& options) {
  const Workers workers(2);
  Layers<T> out(Count(options, images.size()));
  Ok(RasterizeLayers<T>(v, images, options, workers, out.View()));
  return out;
}

// The contract, written down once more.
Layers<double> Naive(const std::vector<double>& v, const std::vector<FaceRange>& images,
                     const LayeredOptions& o) {
  Layers<double> out(0);
  const int shorter = std::min(o.size.width, o.size.height);
  for (const FaceRange& range : images) {
    for (int p = 0; p < o.size.width * o.size.height; ++p) {
      const double x = double(o.size.width - 2 * (p % o.size.width) - 1) / shorter;
      const double y = double(o.size.height - 2 * (p / o.size.width) - 1) / shorter;
      std::vector<std::tuple<double, std::int64_t>> found;
      for (std::int64_t f = range.first; f < range.first + range.count; ++f) {
        const double* c = v.data() + 9 * f;
        const double area = (c[6] - c[0]) * (c[4] - c[1]) - (c[7] - c[1]) * (c[3] - c[0]);
        if (std::min({c[2], c[5], c[8]}) < 1e-8 || std::abs(area) <= 1e-8) continue;
        if (o.cull_backfaces && area < 0) continue;
        const auto at = FragmentOf(c, x, y, o.rule);
        if (at.z < 0 || (!at.inside && at.dist >= o.blur_radius)) continue;
        found.emplace_back(at.z, f);
      }
      std::sort(found.begin(), found.end());
      for (std::size_t k = 0; k < static_cast<std::size_t>(o.faces_per_pixel); ++k) {
        const std::int64_t f = k < found.size() ? std::get<1>(found[k]) : -1;
        out.faces.push_back(f);
        LayeredFragment<double> at{{-1, -1, -1}, -1, -1, false};
        if (f >= 0) at = FragmentOf(v.data() + 9 * f, x, y, o.rule);
        out.z.push_back(at.z);
        out.dists.push_back(at.dist);
        out.bary.insert(out.bary.end(), at.bary.begin(), at.bary.end());
      }
    }
  }
  return out;
}

TEST(LayeredRaster, IsTheNaiveOne) {
  Rng rng(4);
  const std::vector<FaceRange> images = {{0, 50}, {50, 70}, {20, 0}};
  for (int trial = 0; trial < 16; ++trial) {
    LayeredOptions o;
    o.size = {trial % 2 == 0 ? 41 : 23, 23};
    o.faces_per_pixel = trial % 3 == 0 ? 1 : 6;
    o.blur_radius = trial % 4 < 2 ? 0 : 0.02;
    o.cull_backfaces = trial % 5 == 0;
    o.rule = {trial % 4 % 2 == 0, trial % 8 < 4};
    const auto v = RandomFaces<double>(120, trial % 7 == 0 ? 2 : 0.4, &rng);
    const auto expected = Naive(v, images, o);
    EXPECT_GT(std::count_if(expected.faces.begin(), expected.faces.end(),
                            [](std::int64_t id) { return id >= 0; }),
              100);
    EXPECT_EQ(Draw(v, images, o), expected) << trial;
  }
}

TEST(LayeredRaster, FloatIsDouble) {
  Rng rng(5);
  LayeredOptions o;
  o.size = {64, 48};
  o.faces_per_pixel = 4;
  o.blur_radius = 1e-3;
  o.rule.clip_barycentrics = true;
  const auto v = RandomFaces<float>(200, 0.3, &rng);
  const auto single = Draw(v, {{0, 200}}, o);
  const auto exact = Draw(std::vector<double>(v.begin(), v.end()), {{0, 200}}, o);
  // Where faces are equally deep, rounding decides on their order, and here and there on a centre
  // at the limit of a face.
  std::size_t other = 0;
  for (std::size_t i = 0; i < exact.z.size(); ++i) {
    other += std::abs(single.z[i] - exact.z[i]) > 1e-4;
    if (single.faces[i] != exact.faces[i]) continue;
    EXPECT_NEAR(single.dists[i], exact.dists[i], 1e-5);
  }
  EXPECT_LT(other, exact.z.size() / 1000);
}

TEST(LayeredRaster, Errors) {
  const Workers workers(1);
  std::vector<float> v(18, 1);
  LayeredOptions o;
  o.size = {4, 4};
  Layers<float> out(16);
  const auto message = [&](std::vector<FaceRange> images = {{0, 2}}) {
    return RasterizeLayers<float>(v, images, o, workers, out.View()).message();
  };
  EXPECT_EQ(message(), "");
  EXPECT_EQ(message({{1, 2}}), "image 0 has faces [1, 1 + 2), there are 2");
  v[3] = std::numeric_limits<float>::infinity();
  EXPECT_EQ(message(), "face_vertices[3] is inf");
  v[3] = 0;
  o.faces_per_pixel = 0;
  EXPECT_EQ(message(), "faces_per_pixel is 0, must be in 1..1024");
  o.faces_per_pixel = 1;
  o.blur_radius = -1;
  EXPECT_EQ(message(), "blur_radius is -1, must be finite and >= 0");
  o.blur_radius = 0;
  o.size.width = 5;
  EXPECT_EQ(message(), "pix_to_face has 16 numbers, expected 20");
  o.size.width = 4;
  out.faces[3] = 2;
  std::vector<float> d_v(18);
  EXPECT_EQ(RasterizeLayersBackward<float>(v, o, workers, {out.faces, {}, {}, {}, d_v}).message(),
            "pix_to_face[3] is 2, outside of [-1, 2)");
}

// One face at one pixel: the adjoint against a complex step. Known values: test_fragments.py.
using Complex = std::complex<double>;

TEST(LayeredFragment, AdjointIsThatOfAComplexStep) {
  Rng rng(3);
  for (int trial = 0; trial < 400; ++trial) {
    const FragmentRule rule{trial % 2 == 0, trial / 2 % 2 == 0};
    double v[9], d_v[9] = {};
    for (int i = 0; i < 9; ++i) v[i] = i % 3 == 2 ? rng.Uniform(0.5, 3) : rng.Uniform(-1, 1);
    const double px = rng.Uniform(-1, 1), py = rng.Uniform(-1, 1);
    const double d_z = rng.Uniform(-1, 1), d_dist = rng.Uniform(-1, 1);
    const std::array<double, 3> d_bary = {rng.Uniform(-1, 1), rng.Uniform(-1, 1), 1};
    FragmentBackward<double>(v, px, py, rule, d_bary, d_z, d_dist, d_v);
    for (int i = 0; i < 9; ++i) {
      constexpr double kStep = 1e-30;
      std::vector<Complex> shifted(v, v + 9);
      shifted[static_cast<std::size_t>(i)] += Complex(0, kStep);
      const auto at = FragmentOf<Complex>(shifted.data(), Complex(px), Complex(py), rule);
      Complex sum = d_z * at.z + d_dist * at.dist;
      for (std::size_t k = 0; k < 3; ++k) sum += d_bary[k] * at.bary[k];
      const double expected = sum.imag() / kStep;
      EXPECT_NEAR(d_v[i], expected, 1e-9 * (1 + std::abs(expected))) << trial << " " << i;
    }
  }
}

}  // namespace tilegrad::compat::pytorch3d::layered_raster_test
