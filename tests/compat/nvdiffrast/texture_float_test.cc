// SPDX-License-Identifier: Apache-2.0
// Textures in float: the vector body held to the double reference, which gets the same numbers, on
// every instruction set. Texels and cotangents are within [-1, 1]; r is kRounding.
//
// A lookup has kinks, where it passes from texel to texel or from level to level. Pixels that are
// closer to one than their coordinates are exact have no cotangent, and "nearest" is not compared
// there; everything else is smooth, and is off by what its inputs are off by:
//
//   x, y    n s - 1/2 of the size n, s off by 3 r in a cube map (a quotient, and the way from
//           [-1, 1] to [0, 1]) and by r otherwise (its fraction): 5 r n with product and difference
//   weights  products of x, y and the level's share, off by 10 r n + 4 r, plus the error of the
//   share level   1/2 log2 of the square, which is a sum of positive terms of 16 roundings: 12 r;
//   of the
//           logarithm and its sums, below 16: 52 r. Derivatives of a cube map are differences, off
//           by 6 r k / (length of the footprint), k the sum of what is subtracted
//   sums    n terms: n r of their absolute sum
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "compat/nvdiffrast/texture_lookups.h"
#include "compat/nvdiffrast/texture_ref.h"

namespace tilegrad::compat::nvdiffrast::texture_float_test {

constexpr double r = kRounding;

struct FloatCase {
  const char* name;
  TextureFilter filter;
  TextureBoundary boundary;
  std::size_t channels = 3, textures = 1;
  bool uv_da = false, bias = false;
  MipSize size = {16, 32};
};

Lookups<float> LookupsOf(const FloatCase& c) {
  Lookups<float> out;
  out.filter = c.filter;
  out.boundary = c.boundary;
  out.textures = c.textures;
  out.channels = c.channels;
  out.grid = {2, 70, 53};  // two bands, a part of a run
  out.Random(c.size, 20);
  const std::size_t n = c.boundary == TextureBoundary::kCube ? 3 : 2, pixels = out.grid.pixels();
  out.uv = RandomNumbers<float>(pixels * n, 30);
  if (n == 2) {
    for (float& v : out.uv) v *= 1.5f;
  }
  // Some runs of pixels read the same texels, as where a texture is magnified.
  for (std::size_t i = pixels * n / 2; i < pixels * n; ++i) {
    out.uv[i] = out.uv[i / n / 90 * 90 * n + i % n] + 1e-3f * out.uv[i];
  }
  if (c.uv_da) out.uv_da = RandomNumbers<float>(pixels * 2 * n, 35);
  for (float& v : out.uv_da) v *= 0.1f;
  if (c.bias) out.bias = RandomNumbers<float>(pixels, 32);
  for (float& v : out.bias) v = c.uv_da ? v : 2 * v + 1;
  return out;
}

// Of one pixel: what it reads, and by how much numbers are off.
struct PixelBounds {
  texture_ref::PixelLookup lookup{};
  double major = 1;             // of a direction, its largest component
  double place = 0;             // x and y in texels, at the finest level that is read
  double side = 1;              // of that level, in texels
  double level = 0;             // the level, and with it the share of the coarser one
  double length = 1, skew = 1;  // of the footprint; square / root, large if it is round
  bool kink = false;

  PixelBounds(const TextureInput<double>& input, std::size_t pixel) {
    texture_ref::LookUp(input, pixel, &lookup);
    const bool cube = input.boundary == TextureBoundary::kCube;
    if (cube) major = std::max({Uv(0), Uv(1), Uv(2)});
    const MipSize& size = input.levels[lookup.choice.low].size;
    side = std::max(size.width, size.height);
    place = 5 * r * side;
    kink = IsKink(lookup.point.st[0], size.width, input) ||
           IsKink(lookup.point.st[1], size.height, input);
    if (!texture_ref::UsesLevels(input)) return;
    level = 64 * r;
    double exact = input.mip_level_bias.empty() ? 0 : input.mip_level_bias[pixel];
    if (!input.uv_da.empty()) exact += SetFootprint(input.levels[0].size, cube);
    kink = kink || std::abs(exact - std::round(exact)) < level;
  }

  double Uv(int i) const { return std::abs(lookup.at.uv[i]); }
  double LargestDa() const {
    double most = 0;
    for (const double da : lookup.at.uv_da) most = std::max(most, std::abs(da));
    return most;
  }

 private:
  // Of the coarser level kinks are kinks of the finer one, or halfway between two.
  bool IsKink(double s, int n, const TextureInput<double>& input) const {
    const bool nearest = input.filter == TextureFilter::kNearest;
    if (input.boundary == TextureBoundary::kWrap) s -= std::floor(s);
    for (const double x : {s * n - (nearest ? 0 : 0.5), s * n / 2 - 0.5}) {
      if (std::abs(x - std::round(x)) < place) return true;
    }
    return false;
  }
  double SetFootprint(const MipSize& size, bool cube) {
    const double(&s)[4] = lookup.point.slopes;
    const double w = size.width, h = size.height;
    const double a = w * w * s[0] * s[0] + h * h * s[2] * s[2];
    const double b = w * w * s[1] * s[1] + h * h * s[3] * s[3];
    const double c = w * w * s[0] * s[1] + h * h * s[2] * s[3];
    const double root = std::hypot((a - b) / 2, c), square = (a + b) / 2 + root;
    length = std::sqrt(square);
    skew = square / root;
    if (cube) level += 6 * r * 4 * std::max(w, h) * LargestDa() / major / length;
    return LevelOf(s, size);
  }
};

template <class T>
struct GradientsOf {
  std::vector<Numbers<T>> d_levels;
  Numbers<T> d_uv, d_da, d_bias;

  GradientsOf(Lookups<T>& lookups, const Numbers<T>& d_out, const Workers& workers = Workers(1))
      : d_uv(lookups.uv.size(), T(-7)),
        d_da(lookups.uv_da.size(), T(-7)),
        d_bias(lookups.bias.size(), T(-7)) {
    std::vector<std::span<T>> spans;
    for (const auto& level : lookups.levels) d_levels.emplace_back(level.size(), T(-7));
    for (auto& level : d_levels) spans.push_back(level);
    SampleTextureBackward<T>(lookups.input(), d_out, workers, {spans, d_uv, d_da, d_bias});
  }
};

class TextureInFloat : public testing::TestWithParam<FloatCase> {
 protected:
  Lookups<float> lookups_ = LookupsOf(GetParam());
  Lookups<double> exact_ = In<double>(lookups_);
  TextureInput<double> input_ = exact_.input();

  std::vector<PixelBounds> Bounds() const {
    std::vector<PixelBounds> out;
    for (std::size_t p = 0; p < input_.grid.pixels(); ++p) out.emplace_back(input_, p);
    return out;
  }
  bool nearest() const { return exact_.filter == TextureFilter::kNearest; }
};

// 2 dx and 2 dy for differences of texels, 8 weights of 4 r, 8 sums, and the share times the
// difference of levels.
TEST_P(TextureInFloat, SamplesAreTheReferenceUpToRounding) {
  const auto want = Sampled(exact_);
  const auto bounds = Bounds();
  const auto kinks = static_cast<std::size_t>(
      std::count_if(bounds.begin(), bounds.end(), [](const PixelBounds& b) { return b.kink; }));
  EXPECT_LT(kinks, bounds.size() / 50);
  const bool steps = nearest() || exact_.filter == TextureFilter::kLinearMipmapNearest;
  for (const std::string target : EveryTarget()) {
    ExpectWithin("sample", Sampled(lookups_), want, [&](std::size_t i) {
      const PixelBounds& b = bounds[i / exact_.channels];
      if (steps && b.kink) return 2.0;
      return nearest() ? 0 : 4 * b.place + 40 * r + 2 * b.level;
    });
  }
}

// For each number of a level: by how much its gradient is off. Terms are weights times cotangents,
// of which 64 are summed at most before they join a longer sum.
Numbers<double> TexelBounds(const TextureInput<double>& input,
                            const std::vector<PixelBounds>& pixels, const Numbers<double>& d_out,
                            std::size_t level) {
  const std::size_t n = input.channels;
  Numbers<double> errors(input.levels[level].texels.size() / n), sums = errors, counts = errors;
  for (std::size_t p = 0; p < pixels.size(); ++p) {
    const auto& lookup = pixels[p].lookup;
    if (d_out[p * n] == 0) continue;
    for (int i = 0; i < lookup.levels; ++i) {
      if (lookup.choice.low + static_cast<std::size_t>(i) != level) continue;
      texture_ref::WeightedTexels texels;
      texture_ref::FindTexels(input, lookup, i, p / input.grid.image(), &texels);
      for (int k = 0; k < texels.count; ++k) {
        const std::size_t at = texels.texel[k];
        // Its own weight, and a third of that of a corner of a cube map.
        errors[at] += 4.0 / 3 * (2 * pixels[p].place + 4 * r) + pixels[p].level;
        sums[at] += texels.weight[k];
        ++counts[at];
      }
    }
  }
  Numbers<double> out;
  for (std::size_t at = 0; at < errors.size(); ++at) {
    out.insert(out.end(), n, errors[at] + (65 + counts[at]) * r * sums[at]);
  }
  return out;
}

// No cotangents at kinks.
Numbers<float> Cotangents(const std::vector<PixelBounds>& pixels, std::size_t channels) {
  Numbers<float> out = RandomNumbers<float>(pixels.size() * channels, 33);
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (pixels[i / channels].kink) out[i] = 0;
  }
  return out;
}

TEST_P(TextureInFloat, GradientsOfTexelsAreTheReferenceUpToRounding) {
  const auto bounds = Bounds();
  const auto d_out = Cotangents(bounds, exact_.channels);
  const auto d_exact = As<double>(d_out);
  const GradientsOf<double> want(exact_, d_exact);
  std::vector<Numbers<double>> tolerances;
  for (std::size_t l = 0; l < exact_.levels.size(); ++l) {
    tolerances.push_back(TexelBounds(input_, bounds, d_exact, l));
  }
  for (const std::string target : EveryTarget()) {
    for (const int workers : {1, 2, 5}) {
      const GradientsOf<float> got(lookups_, d_out, Workers(workers));
      for (std::size_t l = 0; l < exact_.levels.size(); ++l) {
        ExpectWithin("texel", got.d_levels[l], want.d_levels[l],
                     [&](std::size_t i) { return tolerances[l][i]; });
      }
    }
  }
}

// What a gradient may be, and by how much it is off.
struct Bound {
  double size = 0, error = 0;
};

// Of the gradients of one pixel's coordinates, whose texels' differences are within [-2, 2].
struct CoordinateBounds {
  Bound level, uv, uv_da;

  CoordinateBounds(const PixelBounds& b, const TextureInput<double>& input) {
    const auto n = static_cast<double>(input.channels);
    // d_a = low + b (high - low) of each channel, then their sum.
    const double d_a = n * (4 * b.place + 16 * r + 2 * n * r);
    level = {2 * n, n * (2 * (4 * b.place + 40 * r) + 2 * n * r)};
    uv = {b.side * 2 * n, b.side * (d_a + 2 * n * 2 * (b.level + 4 * r))};
    // The level's derivative is a unit matrix / (length ln 2); it turns with the difference of the
    // footprint's axes.
    const MipSize& size = input.levels[0].size;
    const double by = std::max(size.width, size.height) / (b.length * std::log(2.0));
    uv_da = {by * level.size, 2 * by *
                                  (level.error + level.size * ((20 * b.skew + 40) * r +
                                                               2 * (b.skew + 2) * b.level))};
    if (input.boundary == TextureBoundary::kCube) ToDirection(b);
  }

 private:
  // Quotients of components by the largest one, whose derivatives are all sums of what follows.
  void ToDirection(const PixelBounds& b) {
    const double da = b.LargestDa();
    const auto chain = [&](double d_st, double d_slope) {
      const double g = d_slope / (2 * b.major), d_p = 0.5 * d_st + 2 * g * da;
      return Bound{2 * (4 * g * da + d_p) / b.major, 2 * g};
    };
    const Bound sizes = chain(uv.size, uv_da.size), errors = chain(uv.error, uv_da.error);
    uv = {sizes.size, errors.size + 16 * r * sizes.size};
    uv_da = {sizes.error, errors.error + 16 * r * sizes.error};
  }
};

TEST_P(TextureInFloat, GradientsOfCoordinatesAreTheReferenceUpToRounding) {
  const auto bounds = Bounds();
  const auto d_out = Cotangents(bounds, exact_.channels);
  const GradientsOf<double> want(exact_, As<double>(d_out));
  std::vector<CoordinateBounds> tolerances;
  for (const PixelBounds& b : bounds) tolerances.emplace_back(b, input_);
  const std::size_t n = input_.coordinates();
  for (const std::string target : EveryTarget()) {
    const GradientsOf<float> got(lookups_, d_out);
    ExpectWithin("uv", got.d_uv, want.d_uv,
                 [&](std::size_t i) { return tolerances[i / n].uv.error; });
    ExpectWithin("uv_da", got.d_da, want.d_da,
                 [&](std::size_t i) { return tolerances[i / n / 2].uv_da.error; });
    ExpectWithin("bias", got.d_bias, want.d_bias,
                 [&](std::size_t i) { return tolerances[i].level.error; });
  }
}

// A task finds texels for both kinds of gradients at once, and sums a part of the texels.
TEST_P(TextureInFloat, GradientsHaveTheSameBitsTogetherAndAloneForAnyNumberOfWorkers) {
  const auto d_out = RandomNumbers<float>(exact_.grid.pixels() * exact_.channels, 34);
  for (const std::string target : EveryTarget()) {
    const GradientsOf<float> one(lookups_, d_out);
    for (const int count : {1, 2, 5}) {
      SCOPED_TRACE(count);
      const Workers workers(count);
      GradientsOf<float> both(lookups_, d_out, workers);
      EXPECT_EQ(both.d_levels, one.d_levels);
      EXPECT_EQ(both.d_uv, one.d_uv);
      EXPECT_EQ(both.d_da, one.d_da);
      EXPECT_EQ(both.d_bias, one.d_bias);
      auto alone = both;
      for (auto* numbers : {&alone.d_uv, &alone.d_da, &alone.d_bias}) {
        std::fill(numbers->begin(), numbers->end(), -7.0f);
      }
      SampleTextureBackward<float>(lookups_.input(), d_out, workers,
                                   {{}, alone.d_uv, alone.d_da, alone.d_bias});
      EXPECT_EQ(alone.d_uv, one.d_uv);
      EXPECT_EQ(alone.d_da, one.d_da);
      EXPECT_EQ(alone.d_bias, one.d_bias);
      std::vector<std::span<float>> spans;
      for (auto& level : alone.d_levels) spans.push_back(level);
      SampleTextureBackward<float>(lookups_.input(), d_out, workers, {spans, {}, {}, {}});
      EXPECT_EQ(alone.d_levels, one.d_levels);
    }
  }
}

constexpr auto kNearest = TextureFilter::kNearest, kLinear = TextureFilter::kLinear,
               kMipNearest = TextureFilter::kLinearMipmapNearest,
               kMipLinear = TextureFilter::kLinearMipmapLinear;
constexpr auto kWrap = TextureBoundary::kWrap, kClamp = TextureBoundary::kClamp,
               kZero = TextureBoundary::kZero, kCube = TextureBoundary::kCube;
INSTANTIATE_TEST_SUITE_P(
    All, TextureInFloat,
    testing::Values(FloatCase{"nearest_wrap", kNearest, kWrap},
                    FloatCase{"nearest_clamp", kNearest, kClamp, 1},
                    FloatCase{"nearest_zero", kNearest, kZero, 5, 2},
                    FloatCase{"nearest_cube", kNearest, kCube, 3, 2, false, false, {8, 8}},
                    FloatCase{"wrap", kLinear, kWrap, 1, 2}, FloatCase{"clamp", kLinear, kClamp, 4},
                    FloatCase{"zero", kLinear, kZero, 9},
                    FloatCase{"cube", kLinear, kCube, 3, 1, false, false, {8, 8}},
                    FloatCase{"cube_of_one_texel", kLinear, kCube, 2, 1, false, false, {1, 1}},
                    FloatCase{"mip_nearest", kMipNearest, kWrap, 3, 1, true},
                    FloatCase{"mip_linear", kMipLinear, kWrap, 3, 2, true},
                    FloatCase{"mip_linear_tall", kMipLinear, kClamp, 2, 1, true, true, {32, 4}},
                    FloatCase{"mip_bias", kMipLinear, kClamp, 7, 1, true, true},
                    FloatCase{"bias_alone", kMipLinear, kZero, 4, 1, false, true},
                    FloatCase{"cube_mip", kMipLinear, kCube, 3, 1, true, false, {16, 16}},
                    FloatCase{"cube_mip_bias", kMipLinear, kCube, 6, 2, true, true, {8, 8}},
                    FloatCase{"cube_mip_nearest", kMipNearest, kCube, 1, 1, true, false, {8, 8}}),
    [](const auto& test) { return std::string(test.param.name); });

// Zeros, and nothing is pulled, whatever else the pixel and its neighbours have.
TEST(TextureInFloatAt, NoPointThereIsNothing) {
  constexpr float kInf = std::numeric_limits<float>::infinity(),
                  kNan = std::numeric_limits<float>::quiet_NaN();
  for (const auto boundary : {kWrap, kClamp, kZero, kCube}) {
    for (const auto filter : {kNearest, kLinear, kMipNearest, kMipLinear}) {
      const bool cube = boundary == kCube;
      FloatCase c{"", filter, boundary, 3, 1, true, true, {8, 8}};
      Lookups<float> lookups = LookupsOf(c);
      const std::size_t n = cube ? 3 : 2;
      const float bad[][3] = {{kNan, 0.5f, 0.5f}, {0.5f, kInf, 0.5f}, {-kInf, kNan, 0}, {0, 0, 0}};
      for (std::size_t k = 0; k < (cube ? 4 : 3); ++k) {
        std::copy_n(bad[k], n, &lookups.uv[n * (10 + k)]);
      }
      const std::size_t end = 10 + (cube ? 4 : 3);
      const Numbers<float> d_out(lookups.grid.pixels() * 3, 1.0f);
      for (const std::string target : EveryTarget()) {
        const auto out = Sampled(lookups);
        const GradientsOf<float> got(lookups, d_out);
        for (std::size_t p = 10; p < end; ++p) {
          for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(out[3 * p + i], 0);
          for (std::size_t i = 0; i < n; ++i) EXPECT_EQ(got.d_uv[n * p + i], 0);
          for (std::size_t i = 0; i < 2 * n; ++i) EXPECT_EQ(got.d_da[2 * n * p + i], 0);
          EXPECT_EQ(got.d_bias[p], 0);
        }
        for (const auto* numbers : {&out, &got.d_uv, &got.d_da, &got.d_bias, &got.d_levels[0]}) {
          for (const float v : *numbers) ASSERT_TRUE(std::isfinite(v));
        }
      }
    }
  }
}

}  // namespace tilegrad::compat::nvdiffrast::texture_float_test
