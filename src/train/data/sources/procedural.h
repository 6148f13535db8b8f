// SPDX-License-Identifier: Apache-2.0
// Parametric coloured models from a few families, so that tests and demos need no files.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "scene/mesh.h"

namespace tilegrad::train {

const std::vector<std::string>& ProceduralClasses();  // car, chair, lamp, plane, table

// The `index`-th model of a class: a pure function of (class_index, index, seed). y up, front
// towards +z, about one unit tall, vertex colours, a soup of closed overlapping parts as modelled
// furniture is.
Mesh ProceduralModel(int class_index, std::uint64_t index, std::uint64_t seed);

}  // namespace tilegrad::train
