// SPDX-License-Identifier: Apache-2.0
// Internal to io: colours of vertices, corners and materials as files have them.
#pragma once

#include <glm/vec4.hpp>
#include <string>
#include <vector>

#include "io/mesh_file.h"

namespace tilegrad::io {

// What fractions between 0 and 1 mean: light, as in glTF, or what is shown (sRGB).
enum class ColorNumbers { kLinear, kShown };

// Of what has none beside others that have one: white, whatever those are counted to.
inline constexpr glm::vec4 kNoColor(1, 1, 1, -1);

bool IsFinite(const glm::vec4& color);

// Makes colours of vertices or corners sRGB from 0 to 1. What is counted to 255 or 65535, as nobody
// counts light, is divided; what is more than 1 is cut; each with a warning. Colours that are
// finished stay as they are.
void FinishColors(ColorNumbers numbers, std::vector<glm::vec4>* colors,
                  std::vector<std::string>* warnings);

// The same of all materials, once each.
void FinishMaterials(ColorNumbers numbers, LoadedMesh& loaded);

// A warning if colours of vertices or faces have an alpha below 1 that nothing draws, because all
// materials are opaque.
void WarnOfTransparentColors(LoadedMesh& loaded);

}  // namespace tilegrad::io
