// SPDX-License-Identifier: Apache-2.0
// The streams of a scene side by side, as the renderer interpolates them, and gradients taken apart
// again.
#pragma once

#include <span>
#include <vector>

#include "base/aligned.h"
#include "raster/attributes.h"
#include "render/scene_fields.h"
#include "render/shading/plan.h"
#include "shade/mesh_normals.h"

namespace tilegrad {

// Normals of a scene, where they are derived from its positions: [V] or [F].
using SceneNormals = AlignedVector<shade::UnitVector<float>>;
void DeriveNormals(const Scene& scene, SceneNormals* normals);

// out [rows][channels] in the rate of the set. `normals` as DeriveNormals makes them.
void PackVaryings(const Scene& scene, const VaryingSet& set, const SceneNormals& normals,
                  AlignedVector<float>* out);

// Adds what `packed` [rows][channels], a gradient of PackVaryings' array, says of one stream to
// `stream`: as in the scene; positions for kPosition; for derived normals, [V] or [F] of three.
void AddStream(const Scene& scene, const VaryingSet& set, Varying what,
               std::span<const float> packed, std::span<float> stream);

// Adds to d_positions the adjoint of DeriveNormals. d_units [V] or [F] is overwritten.
void AddNormalsAdjoint(const Scene& scene, const SceneNormals& normals,
                       std::span<shade::Vec3<float>> d_units, std::span<float> d_positions);

}  // namespace tilegrad
