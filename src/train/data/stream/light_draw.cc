// SPDX-License-Identifier: Apache-2.0
#include "train/data/stream/light_draw.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <string_view>

#include "base/error.h"
#include "scene/light_frame.h"

namespace tilegrad::train {
namespace {

constexpr double kPi = std::numbers::pi, kRadians = kPi / 180;
constexpr int kMeanDraws = 4096;
constexpr const char *kHemisphere = "hemisphere", *kFront = "front", *kAbove = "above";
constexpr double kAboveLow = 26, kAboveHigh = 64;  // degrees off the axis

struct Word {
  std::string_view word;
  Lighting lighting;
};
constexpr Word kWords[] = {{"none", Lighting::kNone},
                           {"lambert", Lighting::kLambert},
                           {"phong", Lighting::kPhong},
                           {"harmonics", Lighting::kSphericalHarmonics}};

const Word* Find(std::string_view word) {
  const auto* at = std::find_if(std::begin(kWords), std::end(kWords),
                                [&](const Word& w) { return w.word == word; });
  return at == std::end(kWords) ? nullptr : at;
}

std::array<float, 3> Unit(double x, double y, double z) {
  const double length = std::sqrt(x * x + y * y + z * z);
  if (!(length > 1e-12)) return {0, 0, 1};
  return {static_cast<float>(x / length), static_cast<float>(y / length),
          static_cast<float>(z / length)};
}

// Spread evenly over a spherical cap around z.
std::array<float, 3> DrawInCap(double spread, Rng& rng) {
  const double z = rng.Uniform(std::cos(spread * kPi / 180), 1), turn = rng.Uniform(0, 2 * kPi);
  const double side = std::sqrt(std::max(0.0, 1 - z * z));
  return Unit(side * std::cos(turn), side * std::sin(turn), z);
}

std::array<float, 3> DrawInFront(Rng& rng) {
  const double x = rng.Uniform(-1, 1), y = rng.Uniform(-1, 1);
  return Unit(x, y, rng.Uniform(1, 3));
}

std::array<float, 3> DrawAbove(Rng& rng) {
  const double off = kRadians * rng.Uniform(kAboveLow, kAboveHigh), turn = rng.Uniform(0, kPi);
  return Unit(std::sin(off) * std::cos(turn), std::sin(off) * std::sin(turn), std::cos(off));
}

std::array<float, 3> DrawDirection(const LightConfig& config, Rng& rng) {
  if (config.from == kFront) return DrawInFront(rng);
  if (config.from == kAbove) return DrawAbove(rng);
  return DrawInCap(config.spread, rng);
}

}  // namespace

ConfigFields FieldsOf(LightConfig* c) {
  return {
      {"light.model", &c->model, 0, 0,
       "lighting model: \"none\", \"lambert\", \"phong\" or \"harmonics\""},
      {"light.from", &c->from, 0, 0,
       "light directions: \"hemisphere\" of light.spread, \"front\" (the authors' test code), "
       "\"above\" (the paper's figure)"},
      {"light.spread", &c->spread, 0, 180,
       "largest angle between a light of \"hemisphere\" and the camera, degrees; 90: every light "
       "that faces the object's front"},
      {"light.ambient", &c->ambient, 0, 1,
       "ambient light of Lambert and Phong surfaces; the paper has none"},
      {"light.shininess_low", &c->shininess_low, 1, 1000,
       "lowest shininess of Phong surfaces, drawn log-uniformly"},
      {"light.shininess_high", &c->shininess_high, 1, 1000, "highest shininess of Phong surfaces"},
      {"light.sky_low", &c->sky_low, 0, 1, "lowest ambient fraction of harmonics"},
      {"light.sky_high", &c->sky_high, 0, 1,
       "highest ambient fraction of harmonics; the rest is directional"},
  };
}

Status CheckConfig(const LightConfig& c) {
  if (Find(c.model) == nullptr)
    return InvalidArgument(
        "light.model is \"{}\", but must be \"none\", \"lambert\", \"phong\" or \"harmonics\"",
        c.model);
  if (c.from != kHemisphere && c.from != kFront && c.from != kAbove)
    return InvalidArgument(
        "light.from is \"{}\", but must be \"hemisphere\", \"front\" or \"above\"", c.from);
  if (c.shininess_low > c.shininess_high)
    return InvalidArgument("light.shininess_low is above light.shininess_high");
  if (c.sky_low > c.sky_high) return InvalidArgument("light.sky_low is above light.sky_high");
  return {};
}

Lighting LightingOf(const LightConfig& config) { return Find(config.model)->lighting; }

double WidestAngle(const LightConfig& config) {
  if (config.from == kFront) return std::atan(std::sqrt(2.0)) / kRadians;
  return config.from == kAbove ? kAboveHigh : config.spread;
}

Surface SurfaceUnder(const LightConfig& config) {
  Surface surface;
  surface.ambient.fill(static_cast<float>(config.ambient));
  surface.diffuse.fill(1);
  surface.specular.fill(0.4f);
  return surface;
}

// A cosine that is cut at 0 has the factors pi, 2 pi / 3 and pi / 4 in its first three bands
// (Ramamoorthi, Hanrahan 2001).
std::array<float, 9> SkyAndLight(double sky, const std::array<float, 3>& direction) {
  const std::array<double, 9> basis = HarmonicBasis({direction[0], direction[1], direction[2]});
  std::array<float, 9> out;
  for (std::size_t i = 0; i < 9; ++i) {
    const double band = i == 0 ? kPi : i < 4 ? 2 * kPi / 3 : kPi / 4;
    out[i] = static_cast<float>((1 - sky) * band * basis[i]);
  }
  out[0] += static_cast<float>(sky / basis[0]);
  return out;
}

DrawnLight DrawLight(const LightConfig& config, Rng& rng) {
  DrawnLight light;
  light.direction = DrawDirection(config, rng);
  light.shininess = static_cast<float>(
      config.shininess_low * std::pow(config.shininess_high / config.shininess_low, rng.Uniform()));
  light.sh = SkyAndLight(rng.Uniform(config.sky_low, config.sky_high), light.direction);
  return light;
}

DrawnLight MeanLight(const LightConfig& config) {
  std::array<double, 3> direction = {};
  std::array<double, 9> sh = {};
  double log_shininess = 0;
  Rng rng(0, /*stream=*/0x6d65616e);
  for (int k = 0; k < kMeanDraws; ++k) {
    const DrawnLight light = DrawLight(config, rng);
    for (std::size_t i = 0; i < 3; ++i) direction[i] += light.direction[i];
    for (std::size_t i = 0; i < 9; ++i) sh[i] += light.sh[i] / kMeanDraws;
    log_shininess += std::log(static_cast<double>(light.shininess)) / kMeanDraws;
  }
  DrawnLight mean;
  mean.direction = Unit(direction[0], direction[1], direction[2]);
  mean.shininess = static_cast<float>(std::exp(log_shininess));
  for (std::size_t i = 0; i < 9; ++i) mean.sh[i] = static_cast<float>(sh[i]);
  return mean;
}

std::array<float, 3> DirectionOf(const std::array<float, 9>& sh) {
  return Unit(-sh[3], -sh[1], sh[2]);
}

}  // namespace tilegrad::train
