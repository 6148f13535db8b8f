// SPDX-License-Identifier: Apache-2.0
// The light of one picture, drawn by lot, in one of the rendering models of the paper's
// section 3.4. Directions and harmonics are in the axes of the picture's camera: x right, y up, z
// towards it.
#pragma once

#include <array>
#include <string>

#include "base/rng.h"
#include "tilegrad/scene.h"
#include "train/run/config_fields.h"

namespace tilegrad::train {

struct LightConfig {
  std::string model = "lambert";  // or "none", "phong", "harmonics"
  // "hemisphere": evenly over the cap of half angle `spread` around the camera's axis. "front": as
  // in the authors' test code, (x, y, z) with x and y from [-1, 1] and z from [1, 3]. "above": as
  // in the paper's figure, [26, 64] degrees off the axis, all above it.
  std::string from = "hemisphere";
  double spread = 90;  // degrees; 90: the hemisphere that faces the camera
  double ambient = 0;  // of Lambert and Phong surfaces, beside the light; the paper has none
  double shininess_low = 3, shininess_high = 30;  // of Phong surfaces, drawn log-uniformly
  // Of harmonics: the share of the light that comes from everywhere; the rest has a direction.
  double sky_low = 0.2, sky_high = 0.6;
};

// Colours as they are.
inline LightConfig NoLight() { return {.model = "none"}; }

ConfigFields FieldsOf(LightConfig* config);
// InvalidArgument names a word that is not known, or a range that is upside down.
Status CheckConfig(const LightConfig& config);

Lighting LightingOf(const LightConfig& config);
// No light comes from farther off the camera's axis; degrees.
double WidestAngle(const LightConfig& config);
// k_d 1 and k_s 0.4, as in section 5.3, and the ambient light; without textures.
Surface SurfaceUnder(const LightConfig& config);

struct DrawnLight {
  std::array<float, 3> direction = {0, 0, 1};  // unit, from the surface to the light
  float shininess = 10;                        // Phong
  std::array<float, 9> sh = {};                // harmonics: sky + clamped cosine about `direction`
};

DrawnLight DrawLight(const LightConfig& config, Rng& rng);
// The mean of many draws, with a unit direction: up to a tenth of a degree the one whose mean angle
// to them is least.
DrawnLight MeanLight(const LightConfig& config);

// sky + (1 - sky) max(0, n . direction), by its first three bands.
std::array<float, 9> SkyAndLight(double sky, const std::array<float, 3>& direction);

// The direction from which harmonics are brightest, by their linear part; unit, (0, 0, 1) where
// that is 0.
std::array<float, 3> DirectionOf(const std::array<float, 9>& sh);

}  // namespace tilegrad::train
