// SPDX-License-Identifier: Apache-2.0
#include "fit/masks/color_odds.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

namespace tilegrad::train {
namespace {

constexpr int kColorSide = 24;  // bins along each of the three axes
constexpr std::size_t kBins = std::size_t{kColorSide} * kColorSide * kColorSide;
constexpr float kChroma = 1.5f;                  // differences of channels are small: finer bins
constexpr float kUsual = 1, kLeastUsual = 0.1f;  // densities of what is plainly there, and hardly
constexpr float kDarkest = 0.3f;                 // what a shadow leaves of light
constexpr float kFrontOdds = 2;                  // ln: of what stands before the floor
constexpr float kShadowOdds = -1.5f;  // ln: of the floor, where it is darker than elsewhere
constexpr float kFloor = 0.05f;       // of a density, for colours that nobody has seen

int BinAlong(float value) {
  return std::clamp(static_cast<int>(kColorSide * value), 0, kColorSide - 1);
}

std::uint16_t BinOf(float r, float g, float b) {
  const int light = BinAlong((r + g + b) / 3);
  const int warm = BinAlong(0.5f + kChroma * 0.5f * (r - b));
  const int green = BinAlong(0.5f + kChroma * 0.25f * (2 * g - r - b));
  return static_cast<std::uint16_t>((light * kColorSide + warm) * kColorSide + green);
}

std::vector<std::uint16_t> BinsOf(const TargetImages& images, std::size_t view) {
  const std::size_t plane = images.pixels();
  const float* red = &images.color[3 * view * plane];
  std::vector<std::uint16_t> out(plane);
  for (std::size_t p = 0; p < plane; ++p)
    out[p] = BinOf(red[p], red[plane + p], red[2 * plane + p]);
  return out;
}

// (1, 2, 1) / 4 along an axis whose neighbours are `stride` apart.
void BlurAlong(std::size_t stride, std::vector<float>* bins) {
  const std::vector<float> from = *bins;
  for (std::size_t i = 0; i < kBins; ++i) {
    const std::size_t at = i / stride % kColorSide;
    const float before = at > 0 ? from[i - stride] : from[i];
    const float after = at + 1 < kColorSide ? from[i + stride] : from[i];
    (*bins)[i] = 0.25f * (before + 2 * from[i] + after);
  }
}

void MakeDensity(std::vector<float>* bins) {
  for (const std::size_t stride :
       {std::size_t{1}, std::size_t{kColorSide}, std::size_t{kColorSide} * kColorSide})
    BlurAlong(stride, bins);
  const double sum = std::accumulate(bins->begin(), bins->end(), 0.0);
  const auto scale = static_cast<float>(static_cast<double>(kBins) / std::max(sum, 1e-9));
  for (float& bin : *bins) bin *= scale;
}

std::size_t BinAt(float light, float warm, float green) {
  return static_cast<std::size_t>((static_cast<int>(light) * kColorSide + static_cast<int>(warm)) *
                                      kColorSide +
                                  static_cast<int>(green));
}

// How far each bin, in [0, 1], is that of something outside, but darker.
std::vector<float> Darker(const std::vector<float>& outside) {
  constexpr float kFirst = 0.95f, kStep = 0.05f, kGrey = 0.5f * kColorSide;
  std::vector<float> out(kBins);
  for (std::size_t i = 0; i < kBins; ++i) {
    const float usual = std::min(outside[i] / kUsual, 1.0f);
    if (usual < kLeastUsual) continue;
    const float light = static_cast<float>(i / (kColorSide * kColorSide)) + 0.5f,
                warm = static_cast<float>(i / kColorSide % kColorSide) + 0.5f - kGrey,
                green = static_cast<float>(i % kColorSide) + 0.5f - kGrey;
    for (float s = kFirst; s > kDarkest; s -= kStep) {
      float& to = out[BinAt(s * light, s * warm + kGrey, s * green + kGrey)];
      to = std::max(to, usual);
    }
  }
  return out;
}

void AddTo(std::vector<float>* sum, const std::vector<float>& more) {
  std::ranges::transform(*sum, more, sum->begin(), std::plus<>());
}

struct Densities {
  std::vector<float> in = std::vector<float>(kBins), out = std::vector<float>(kBins);

  void Add(const Densities& more) {
    AddTo(&in, more.in);
    AddTo(&out, more.out);
  }
  void Normalise() {
    MakeDensity(&in);
    MakeDensity(&out);
  }
};

}  // namespace

ColorOdds::ColorOdds(const TargetImages& images, const Workers& workers)
    : plane_(images.pixels()),
      bins_(images.alpha.size()),
      odds_(images.alpha.size() / images.pixels()),
      shadow_(odds_.size()) {
  workers.For(odds_.size(), [&](std::size_t v, std::size_t) {
    std::ranges::copy(BinsOf(images, v), bins_.begin() + static_cast<std::ptrdiff_t>(v * plane_));
  });
}

void ColorOdds::Learn(std::span<const float> inside, const Workers& workers) {
  std::vector<Densities> views(odds_.size());
  workers.For(views.size(), [&](std::size_t v, std::size_t) {
    for (std::size_t p = v * plane_; p < (v + 1) * plane_; ++p) {
      views[v].in[bins_[p]] += inside[p];
      views[v].out[bins_[p]] += 1 - inside[p];
    }
  });
  Densities all;
  for (const Densities& view : views) all.Add(view);
  all.Normalise();
  workers.For(views.size(), [&](std::size_t v, std::size_t) {
    views[v].Normalise();
    views[v].Add(all);
    odds_[v].resize(kBins);
    for (std::size_t i = 0; i < kBins; ++i) {
      const float ratio = (views[v].in[i] + 2 * kFloor) / (views[v].out[i] + 2 * kFloor);
      odds_[v][i] = std::clamp(std::log(ratio), -kMostOdds, kMostOdds);
    }
    shadow_[v] = Darker(views[v].out);
  });
}

std::vector<float> ColorOdds::Of(const TargetImages& images, std::size_t view,
                                 std::span<const float> floor) const {
  const std::vector<std::uint16_t> bins = BinsOf(images, view);
  std::vector<float> out(bins.size());
  for (std::size_t p = 0; p < out.size(); ++p) {
    const float shadow = std::max(floor[p], 0.0f) * shadow_[view][bins[p]];
    out[p] = (1 - shadow) * odds_[view][bins[p]] + shadow * kShadowOdds;
    if (floor[p] < 0) out[p] -= floor[p] * kFrontOdds;
  }
  return out;
}

}  // namespace tilegrad::train
