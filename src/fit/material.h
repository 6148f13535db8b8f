// SPDX-License-Identifier: Apache-2.0
// Fits with light of their own: what an image shows is the surface's colour times the light on it,
// and both are learned. The light is white or, of Phong, has a colour for each channel; it stays
// where it is in the object's world, for all images; nothing casts a shadow.
//
// Images alone do not tell colour from light: of a light that stays, each texel always has the same
// share. Two assumptions do. The mean of the light over all directions is 1, whatever is learned
// (FitScene::light_mean_fixed). And colours do not depend on where the surface looks: until
// `texture_rest` the texture is the images' mean colour, so that the light explains all it can;
// then the texture moves, and the light a tenth as fast as before.
#pragma once

#include <glm/vec3.hpp>
#include <optional>

#include "base/file.h"
#include "fit/config.h"
#include "fit/input.h"
#include "fit/scene.h"

namespace tilegrad::train {

// An error if a light is chosen as well.
Status CheckMaterial(const FitConfig& config);

// Light and schedule of a material that is not unlit; else nothing.
void SetMaterial(bool from_hull, FitConfig* config);

// What is learned of it, beside shape and colour.
ParameterSet LightParameters(MaterialKind material);

// Colours become the mean of the training images' object if they are `blank`, and the light's mean
// 1, half of it from everywhere.
void StartMaterial(const FitInput& input, bool blank, FitScene* scene);

// Where most light of a scene comes from (not 0, of length 1), and the light on a surface that
// looks there, by channel. None: from everywhere alike, to a twentieth, or the scene has no light.
struct MainLight {
  glm::dvec3 direction = {0, 0, 1};
  glm::dvec3 facing = {1, 1, 1};
};
std::optional<MainLight> MainLightOf(const FitScene& scene);

// The mesh as a GLB. Of a scene whose light's mean is fixed: base colours are what a surface looks
// like that faces the main light, and there is a directional light from there
// (KHR_lights_punctual); glTF knows no other, so what comes from elsewhere is left to viewers.
Status SaveFittedGlb(const Path& file, const FitScene& scene);

}  // namespace tilegrad::train
