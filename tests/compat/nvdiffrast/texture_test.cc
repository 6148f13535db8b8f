// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/texture.h"

#include <gtest/gtest.h>

#include "compat/nvdiffrast/test_util.h"
#include "compat/nvdiffrast/texture_cube.h"
#include "compat/nvdiffrast/texture_lookups.h"
#include "compat/nvdiffrast/texture_taps.h"
#include "support/expect.h"

namespace tilegrad::compat::nvdiffrast::texture_test {

// 4 x 2 texels, 10 times the row plus the column.
Lookups<double> Ramp(TextureFilter filter, TextureBoundary boundary) {
  Lookups<double> out;
  out.filter = filter;
  out.boundary = boundary;
  out.sizes = {{2, 4}};
  out.levels = {{0, 1, 2, 3, 10, 11, 12, 13}};
  return out;
}

double At(Lookups<double> lookups, double s, double t) {
  lookups.uv = {s, t};
  return Sampled(lookups)[0];
}

TEST(Texture, LinearAndNearestByHand) {
  const auto linear = Ramp(TextureFilter::kLinear, TextureBoundary::kClamp);
  EXPECT_NEAR(At(linear, 0.125, 0.25), 0, 1e-12);  // the centre of the first texel; row 0 at t = 0
  EXPECT_NEAR(At(linear, 0.875, 0.75), 13, 1e-12);
  EXPECT_NEAR(At(linear, 0.25, 0.5), 5.5, 1e-12);  // between four
  EXPECT_NEAR(At(linear, 0.30, 0.25), 0.7, 1e-12);
  EXPECT_NEAR(At(linear, -3, 9), 10, 1e-12);  // clamped to the centres of the outer texels
  const auto nearest = Ramp(TextureFilter::kNearest, TextureBoundary::kClamp);
  EXPECT_EQ(At(nearest, 0.249, 0.499), 0);
  EXPECT_EQ(At(nearest, 0.251, 0.501), 11);
  EXPECT_EQ(At(nearest, 1.0, 1.0), 13);
  EXPECT_EQ(At(nearest, -5, -5), 0);
}

TEST(Texture, BoundariesByHand) {
  const auto wrap = Ramp(TextureFilter::kLinear, TextureBoundary::kWrap);
  EXPECT_NEAR(At(wrap, 0, 0.25), 1.5, 1e-12);  // between the last and the first column
  EXPECT_NEAR(At(wrap, 1, 0.25), 1.5, 1e-12);
  EXPECT_NEAR(At(wrap, -0.7, 3.25), At(wrap, 0.3, 0.25), 1e-12);
  EXPECT_EQ(At(Ramp(TextureFilter::kNearest, TextureBoundary::kWrap), -0.01, 1.1), 3);
  const auto zero = Ramp(TextureFilter::kLinear, TextureBoundary::kZero);
  EXPECT_NEAR(At(zero, 1, 0.75), 6.5, 1e-12);  // half of 13, half of nothing
  EXPECT_NEAR(At(zero, 1, 1), 3.25, 1e-12);
  EXPECT_NEAR(At(zero, 1.2, 0.5), 0, 1e-12);
  EXPECT_NEAR(At(zero, 1e30, 0.5), 0, 1e-12);
  EXPECT_EQ(At(Ramp(TextureFilter::kNearest, TextureBoundary::kZero), 1.01, 0.6), 0);
  EXPECT_EQ(At(wrap, std::nan(""), 0.5), 0);
}

// (Not "Longer": tests with Long in their names run with --long only.)
TEST(Texture, ALevelIsOneTexelForEachPixelOfTheWiderAxis) {
  Lookups<double> lookups;
  lookups.filter = TextureFilter::kLinearMipmapLinear;
  lookups.sizes = MipSizes({16, 16}, -1).value();
  ASSERT_EQ(lookups.sizes.size(), 5u);
  for (std::size_t l = 0; l < 5; ++l) {
    const auto side = static_cast<std::size_t>(lookups.sizes[l].width);
    lookups.levels.emplace_back(side * side, static_cast<double>(l));  // shows its own number
  }
  lookups.uv = {0.3, 0.6};
  const auto level = [&](double texels_x, double texels_y) {
    lookups.uv_da = {texels_x / 16, 0, 0, texels_y / 16};
    return Sampled(lookups)[0];
  };
  EXPECT_NEAR(level(1, 1), 0, 1e-12);
  EXPECT_NEAR(level(2, 1), 1, 1e-12);
  EXPECT_NEAR(level(1, 4), 2, 1e-12);
  EXPECT_NEAR(level(3, 0), std::log2(3.0), 1e-12);
  EXPECT_NEAR(level(0, 0), 0, 1e-12);
  EXPECT_NEAR(level(1e9, 0), 4, 1e-12);
  // Turned by 45 degrees, sheared: the singular value of (2 2; -2 2) is 2 sqrt(2).
  lookups.uv_da = {2.0 / 16, 2.0 / 16, -2.0 / 16, 2.0 / 16};
  EXPECT_NEAR(Sampled(lookups)[0], 1.5, 1e-12);
  lookups.bias = {0.75};
  EXPECT_NEAR(Sampled(lookups)[0], 2.25, 1e-12);
  lookups.uv_da.clear();
  lookups.bias = {3.6};
  EXPECT_NEAR(Sampled(lookups)[0], 3.6, 1e-12);
}

TEST(Texture, TheNearestLevelIsRoundedDown) {
  Lookups<double> lookups;
  lookups.filter = TextureFilter::kLinearMipmapNearest;
  lookups.sizes = MipSizes({4, 8}, -1).value();
  for (std::size_t l = 0; l < 4; ++l) {
    const auto& size = lookups.sizes[l];
    const auto texels = static_cast<std::size_t>(size.height * size.width);
    lookups.levels.emplace_back(texels, static_cast<double>(l));  // shows its own number
  }
  const double levels[][2] = {{-3, 0},   {0, 0},    {0.49, 0}, {0.5, 0}, {0.99, 0}, {1, 1},
                              {1.75, 1}, {2.25, 2}, {2.99, 2}, {3, 3},   {9.7, 3}};
  lookups.grid = {1, 1, static_cast<int>(std::size(levels))};
  for (const auto& level : levels) {
    lookups.uv.insert(lookups.uv.end(), {0.3, 0.6});
    lookups.bias.push_back(level[0]);
  }
  const auto out = Sampled(lookups);
  // The same by footprints of 2^level texels, and in float.
  for (const auto& level : levels) {
    lookups.uv_da.insert(lookups.uv_da.end(), {std::exp2(level[0]) / 8, 0, 0, 0});
  }
  lookups.bias.clear();
  const auto by_footprint = Sampled(lookups);
  Lookups<float> single = In<float>(lookups);
  const auto in_float = Sampled(single);
  for (std::size_t i = 0; i < std::size(levels); ++i) {
    EXPECT_NEAR(out[i], levels[i][1], 1e-12) << levels[i][0];
    EXPECT_NEAR(by_footprint[i], levels[i][1], 1e-12) << levels[i][0];
    EXPECT_NEAR(double{in_float[i]}, levels[i][1], 4 * kRounding * 3) << levels[i][0];
  }
}

TEST(Mip, LevelsAreMeansAndSizesAreChecked) {
  const auto sizes = MipSizes({4, 16}, -1).value();
  ASSERT_EQ(sizes.size(), 5u);
  EXPECT_EQ(sizes[3].height, 1);
  EXPECT_EQ(sizes[3].width, 2);
  EXPECT_EQ(MipSizes({4, 16}, 1).value().size(), 2u);
  EXPECT_EQ(MipSizes({4, 16}, 0).value().size(), 1u);
  EXPECT_EQ(MipSizes({32, 160}, 5).value().size(), 6u);
  ExpectMessage(MipSizes({32, 160}, -1).status(), "32 x 160", "max_mip_level to 5");
  const Numbers<double> fine = {0, 1, 2, 3, 10, 11, 12, 13};
  Numbers<double> coarse(2), last(1);
  HalveTexture<double>({fine, {2, 4}}, 1, Workers(1), coarse);
  EXPECT_EQ(coarse, (Numbers<double>{5.5, 7.5}));
  HalveTexture<double>({coarse, {1, 2}}, 1, Workers(1), last);
  EXPECT_EQ(last, Numbers<double>{6.5});
}

TEST(Mip, BackwardIsTheTransposed) {
  for (const MipSize size : {MipSize{4, 6}, MipSize{1, 8}, MipSize{6, 1}}) {
    const auto n = static_cast<std::size_t>(2 * size.height * size.width * 3);
    const std::size_t ratio = size.height > 1 && size.width > 1 ? 4 : 2;
    const auto fine = RandomNumbers<double>(n, 1), d = RandomNumbers<double>(n / ratio, 2);
    Numbers<double> coarse(n / ratio), d_fine(n);
    HalveTexture<double>({fine, size}, 3, Workers(2), coarse);
    const MipSize half{std::max(1, size.height / 2), std::max(1, size.width / 2)};
    HalveTextureBackward<double>({d, half}, size, 3, Workers(2), d_fine);
    EXPECT_NEAR(Dot<double>(coarse, d), Dot<double>(fine, d_fine), 1e-12);
  }
}

TEST(CubeMap, FacesAreThoseOfOpenGl) {
  Lookups<double> lookups;
  lookups.boundary = TextureBoundary::kCube;
  lookups.filter = TextureFilter::kNearest;
  lookups.sizes = {{2, 2}};
  lookups.levels = {Numbers<double>(24)};
  for (std::size_t i = 0; i < 24; ++i) lookups.levels[0][i] = static_cast<double>(i);
  const auto at = [&](double x, double y, double z) {
    lookups.uv = {x, y, z};
    return Sampled(lookups)[0];
  };
  // The table of the OpenGL specification: on +x, s goes with -z and t with -y, and so on.
  EXPECT_EQ(at(1, 0.5, 0.5), 0 + 0);
  EXPECT_EQ(at(1, 0.5, -0.5), 0 + 1);
  EXPECT_EQ(at(1, -0.5, 0.5), 0 + 2);
  EXPECT_EQ(at(-1, 0.5, -0.5), 4 + 0);
  EXPECT_EQ(at(-0.5, 1, -0.5), 8 + 0);
  EXPECT_EQ(at(0.5, 1, -0.5), 8 + 1);
  EXPECT_EQ(at(-0.5, -1, 0.5), 12 + 0);
  EXPECT_EQ(at(-0.5, 0.5, 1), 16 + 0);
  EXPECT_EQ(at(0.5, -0.5, 1), 16 + 3);
  EXPECT_EQ(at(0.5, 0.5, -1), 20 + 0);
  EXPECT_EQ(at(-3, 0.5, -7), 20 + 1);
  EXPECT_EQ(at(0, 0, 0), 0);
  EXPECT_EQ(at(0, std::nan(""), 1), 0);
}

// The direction of a texel's centre.
Direction CentreOfTexel(int face, int x, int y, int size) {
  const CubeFace& f = kCubeFaces[face];
  Direction r{};
  r[static_cast<std::size_t>(f.major.index)] = f.major.sign;
  r[static_cast<std::size_t>(f.s.index)] = f.s.sign * ((2.0 * x + 1) / size - 1);
  r[static_cast<std::size_t>(f.t.index)] = f.t.sign * ((2.0 * y + 1) / size - 1);
  return r;
}

TEST(CubeMap, AcrossAnEdgeIsTheTexelBesideIt) {
  for (const int size : {1, 2, 3, 8, 64, 1024}) {
    for (int face = 0; face < 6; ++face) {
      for (int i = 0; i < size; ++i) {
        for (const CubeTexel out : {CubeTexel{face, -1, i}, CubeTexel{face, size, i},
                                    CubeTexel{face, i, -1}, CubeTexel{face, i, size}}) {
          const CubeTexel there = AcrossEdge(out, size);
          ASSERT_NE(there.face, face);
          // Both texels touch the same piece of the edge: of their centres, the component along it
          // agrees, and the other two have changed places.
          const CubeTexel here = {face, std::clamp(out.x, 0, size - 1),
                                  std::clamp(out.y, 0, size - 1)};
          const Direction a = CentreOfTexel(face, here.x, here.y, size);
          const Direction b = CentreOfTexel(there.face, there.x, there.y, size);
          double apart = 0;
          for (std::size_t c = 0; c < 3; ++c) apart += (a[c] - b[c]) * (a[c] - b[c]);
          EXPECT_NEAR(std::sqrt(apart), std::sqrt(2.0) / size, 1e-9) << size << " " << face;
        }
      }
    }
  }
}

TEST(CubeMap, LinearLookupsHaveNoSeam) {
  Lookups<double> lookups;
  lookups.boundary = TextureBoundary::kCube;
  lookups.Random({4, 4}, 3);
  Rng rng(1, 1);
  // Beside an edge of the cube, and beside a corner: a small step changes little.
  for (int round = 0; round < 2000; ++round) {
    Direction r = {rng.Uniform(-1, 1), rng.Uniform(-1, 1), rng.Uniform(-1, 1)};
    const std::size_t a = rng.Below(3), b = (a + 1 + rng.Below(2)) % 3;
    const double side = rng.Uniform() < 0.5 ? -1 : 1;
    r[a] = 1;
    r[b] = side;
    if (round % 4 == 0) r[3 - a - b] = 1 - 1e-9 * rng.Uniform();
    double values[2];
    for (int i = 0; i < 2; ++i) {
      r[a] = 1 + (i == 0 ? 1e-9 : -1e-9);
      lookups.uv = {r[0], r[1], r[2]};
      values[i] = Sampled(lookups)[0];
    }
    EXPECT_NEAR(values[0], values[1], 1e-7) << r[0] << " " << r[1] << " " << r[2];
  }
}

}  // namespace tilegrad::compat::nvdiffrast::texture_test
