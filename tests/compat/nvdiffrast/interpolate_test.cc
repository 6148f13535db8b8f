// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/interpolate.h"

#include <gtest/gtest.h>

#include "compat/nvdiffrast/test_util.h"

namespace tilegrad::compat::nvdiffrast {
namespace {

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
  const Status status = Interpolate<T>(input, workers, {images.out, images.out_da});
  EXPECT_TRUE(status.ok()) << status.message();
  return images;
}

Scene<double> TwoViews() {
  Scene<double> scene = WavyGrid(3, 1, 12, 15);
  const auto other = WavyGrid(3, 2, 12, 15).positions;
  scene.positions.insert(scene.positions.end(), other.begin(), other.end());
  scene.images = 2;
  return scene;
}

TEST(Interpolate, PositionsComeBackAtPixelCentres) {
  // Attributes x, y, w: perspective-correct, x/w and y/w of the surface are those of the centre.
  const Scene<double> scene = TwoViews();
  Attributes<double> attributes;
  for (std::size_t v = 0; v < scene.positions.size() / 4; ++v) {
    for (const std::size_t i : {0, 1, 3}) attributes.values.push_back(scene.positions[4 * v + i]);
  }
  attributes.diff = {};
  const auto rasterized = Rasterize(scene);
  const auto images = Interpolated(InputOf(scene, attributes, rasterized));
  std::size_t seen = 0;
  for (std::size_t p = 0; p < scene.grid().pixels(); ++p) {
    const double* out = &images.out[3 * p];
    if (rasterized.rast[4 * p + 3] == 0) {
      EXPECT_EQ(out[0], 0);
      EXPECT_EQ(out[2], 0);
      continue;
    }
    // A centre within 1/2048 pixel of the mesh's border may be kept on it.
    const auto x = static_cast<int>(p % 15), y = static_cast<int>(p / 15 % 12);
    const PixelCentre at = CentreOf(scene.grid(), x, y);
    EXPECT_NEAR(out[0] / out[2], at.x, 2e-4);
    EXPECT_NEAR(out[1] / out[2], at.y, 2e-4);
    ++seen;
  }
  EXPECT_GT(seen, 150u);
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

TEST(Interpolate, GradientsByDifferences) {
  for (const bool shared : {false, true}) {
    const Scene<double> scene = TwoViews();
    Rasterized<double> rasterized = Rasterize(scene);
    Attributes<double> attributes;
    attributes.shared = shared;
    attributes.values = RandomNumbers<double>(scene.vertices() * 3 * (shared ? 1 : 2), 4);
    const auto d_out = RandomNumbers<double>(scene.grid().pixels() * 3, 5);
    const auto d_da = RandomNumbers<double>(scene.grid().pixels() * 4, 6);
    Numbers<double> d_attributes(attributes.values.size()), d_rast(rasterized.rast.size()),
        d_db(rasterized.rast.size());
    const Workers workers(2);
    ASSERT_TRUE(InterpolateBackward<double>(InputOf(scene, attributes, rasterized), {d_out, d_da},
                                            workers, {d_attributes, d_rast, d_db})
                    .ok());
    const auto loss = [&] {
      const auto images = Interpolated(InputOf(scene, attributes, rasterized), workers);
      return Dot<double>(images.out, d_out) + Dot<double>(images.out_da, d_da);
    };
    ExpectGradient("attribute", &attributes.values, d_attributes, loss);
    ExpectGradient("rast_db", &rasterized.rast_db, d_db, loss);
    // z/w and face ids have no gradient; u and v are checked pixel by pixel.
    for (std::size_t p = 0; p < scene.grid().pixels(); ++p) {
      EXPECT_EQ(d_rast[4 * p + 2], 0);
      EXPECT_EQ(d_rast[4 * p + 3], 0);
      for (std::size_t i = 0; i < 2; ++i) {
        double& u = rasterized.rast[4 * p + i];
        const double before = u;
        u = before + 1e-5;
        const double up = loss();
        u = before - 1e-5;
        const double down = loss();
        u = before;
        EXPECT_NEAR(d_rast[4 * p + i], (up - down) / 2e-5, 1e-7);
      }
    }
  }
}

TEST(Interpolate, SameBitsForAnyNumberOfWorkers) {
  const Scene<float> scene = AsScene<float>(WavyGrid(12, 7, 200, 130));
  const auto rasterized = Rasterize(scene);
  Attributes<float> attributes;
  attributes.values = RandomNumbers<float>(scene.vertices() * 3, 8);
  const auto input = InputOf(scene, attributes, rasterized);
  const auto d_out = RandomNumbers<float>(scene.grid().pixels() * 3, 9);
  const auto d_da = RandomNumbers<float>(scene.grid().pixels() * 4, 10);
  const auto expected = Interpolated(input);
  Numbers<float> first;
  for (const int count : {1, 2, 7}) {
    const Workers workers(count);
    const auto images = Interpolated(input, workers);
    EXPECT_EQ(images.out, expected.out);
    EXPECT_EQ(images.out_da, expected.out_da);
    Numbers<float> d(attributes.values.size());
    ASSERT_TRUE(InterpolateBackward<float>(input, {d_out, d_da}, workers, {d, {}, {}}).ok());
    if (first.empty()) first = d;
    EXPECT_EQ(d, first) << count;
  }
}

TEST(Interpolate, BadInputIsNamed) {
  const Scene<float> scene = AsScene<float>(WavyGrid(1, 1, 4, 4));
  auto rasterized = Rasterize(scene);
  Attributes<float> attributes;
  attributes.values = RandomNumbers<float>(12, 8);
  attributes.diff = {3};
  Numbers<float> out(48), out_da(32);
  const auto message = [&] {
    return Interpolate<float>(InputOf(scene, attributes, rasterized), Workers(1), {out, out_da})
        .message();
  };
  EXPECT_NE(message().find("attribute 3, but there are 3"), std::string::npos);
  attributes.diff = {0};
  rasterized.rast[4 * 5 + 3] = 9;
  EXPECT_NE(message().find("pixel 5 of rast names triangle 9"), std::string::npos);
  rasterized.rast[4 * 5 + 3] = 0.5f;
  EXPECT_NE(message().find("pixel 5 of rast names triangle 0.5"), std::string::npos);
}

}  // namespace
}  // namespace tilegrad::compat::nvdiffrast
