// SPDX-License-Identifier: Apache-2.0
// Convolutions and texture lookups against their references, on any SIMD target.
#include <algorithm>
#include <array>
#include <cmath>

#include "fuzz/numbers.h"
#include "fuzz/target.h"
#include "nn/kernels/kernel_trial.h"
#include "shade/texture.h"
#include "shade/texture_levels.h"
#include "shade/texture_levels_ref.h"

namespace tilegrad::fuzz::layer_targets {

nn::Conv2dShape ShapeOf(Numbers* in) {
  nn::Conv2dShape s;
  s.batch = 1 + in->Below(3);
  s.in_channels = 1 + in->Below(9);
  s.out_channels = 1 + in->Below(12);
  s.kernel_height = 1 + in->Below(5);
  s.kernel_width = 1 + in->Below(5);
  s.stride = 1 + in->Below(3);
  s.padding = in->Below(4);
  s.in_height = 1 + in->Below(14);
  s.in_width = 1 + in->Below(14);
  return s;
}

void RequireWithinRounding(const std::vector<float>& got, const std::vector<double>& want,
                           const std::vector<double>& magnitude, std::size_t roundings) {
  Require(got.size() == want.size(), "a result of the right size");
  for (std::size_t i = 0; i < got.size(); ++i) {
    const double error = std::abs(static_cast<double>(got[i]) - want[i]);
    Require(error <= nn::Gamma(roundings) * magnitude[i], "a convolution within its rounding");
  }
}

// All three products of a convolution, and the same bits from one worker and from two. Winograd's
// has another bound on its rounding (nn/kernels/conv2d_test.cc) and only the latter here.
void Convolution(Input input) {
  Numbers in(input);
  const TargetScope scope(TargetOf(&in));
  const nn::Conv2dShape s = ShapeOf(&in);
  const bool winograd = in.Below(4) == 0;
  if (!s.Check().ok()) return;
  nn::Conv2dOperands o = nn::RandomConv2dOperands(s, in.Take<std::uint16_t>());
  for (float& x : o.x) {
    if (!in.empty()) x = static_cast<float>(in.Take<std::int8_t>()) / 16;
  }
  const nn::Conv2dResults got = nn::RunConv2d(s, o, {.winograd = winograd});
  Require(nn::RunConv2d(s, o, {.workers = 2, .winograd = winograd}) == got,
          "the same bits from two workers");
  if (winograd) return;
  const nn::Conv2dTruth want = nn::RunConv2dReference(s, o, nn::AsDoubles);
  const nn::Conv2dTruth magnitude = nn::RunConv2dReference(s, o, nn::Magnitudes);
  const nn::Conv2dRoundings most(s);
  RequireWithinRounding(got.y, want.y, magnitude.y, most.y);
  RequireWithinRounding(got.d_x, want.d_x, magnitude.d_x, most.d_x);
  RequireWithinRounding(got.d_weight, want.d_weight, magnitude.d_weight, most.d_weight);
}

// A coordinate of the texture and around it; else any float.
float CoordinateOf(Numbers* in, bool* usual) {
  *usual = in->Below(8) != 0;
  return *usual ? static_cast<float>(in->Take<std::int16_t>()) / 10923 : in->Take<float>();
}

std::array<float, 3> Sample(const shade::TexturePyramid& pyramid, float u, float v, float level) {
  shade::RunPlane uv[2], levels, color[3];
  std::fill_n(uv[0].at, shade::kRunPad, u);
  std::fill_n(uv[1].at, shade::kRunPad, v);
  std::fill_n(levels.at, shade::kRunPad, level);
  const shade::TextureView& view = pyramid.view();
  shade::SampleTexture(1, {pyramid.levels(), view.wrap, view.filter, uv, &levels}, color);
  return {color[0].at[0], color[1].at[0], color[2].at[0]};
}

// Whatever the coordinates, a colour is one of the texture's or between them; and where they are
// near the texture it is the reference's. Nearest texels may be the neighbour's on a border.
void Texture(Input input) {
  Numbers in(input);
  const TargetScope scope(TargetOf(&in));
  const int width = 1 + static_cast<int>(in.Below(16)), height = 1 + static_cast<int>(in.Below(16));
  const auto wrap = static_cast<Wrap>(in.Below(9));
  const auto filter = static_cast<Filter>(in.Below(3));
  std::vector<float> texels(3 * static_cast<std::size_t>(width * height));
  Rng rng(in.Take<std::uint8_t>(), 9);
  for (float& t : texels) t = static_cast<float>(rng.Uniform());
  const shade::TextureView view{texels, width, height, 3, wrap, filter};
  shade::TexturePyramid pyramid;
  pyramid.Build(view);
  const shade::PyramidRef<float> reference(view);
  while (!in.empty()) {
    bool usual_u = true, usual_v = true;
    const float u = CoordinateOf(&in, &usual_u), v = CoordinateOf(&in, &usual_v);
    const float level = static_cast<float>(in.Take<std::int8_t>()) / 25;
    const auto got = Sample(pyramid, u, v, level);
    for (std::size_t c = 0; c < 3; ++c)
      Require(got[c] >= -1e-5f && got[c] <= 1 + 1e-5f, "a colour of the texture");
    if (!usual_u || !usual_v || filter == Filter::kNearest) continue;
    const auto want = shade::SampleRef(reference, u, v, level);
    for (std::size_t c = 0; c < 3; ++c)
      Require(std::abs(got[c] - want[c]) <= 4e-5f, "the reference's colour");
  }
}

const Registration kTargets[] = {
    Registration({"convolution", Convolution, RandomSeeds<8, 60>, nullptr, 2}),
    Registration({"texture", Texture, RandomSeeds<8, 60>}),
};

}  // namespace tilegrad::fuzz::layer_targets
