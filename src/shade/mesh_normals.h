// SPDX-License-Identifier: Apache-2.0
// Normals derived from positions, with their gradient.
//
//   face:    n_f = (b - a) x (c - a), with length twice the area
//   flat:    n_f / |n_f|, for each face
//   smooth:  sum of n_f over the faces of a vertex, normalised: area-weighted
//
// The normal of a face without area or a vertex without faces is 0 and has no gradient. The same
// holds where the faces' normals cancel up to rounding, as on a sheet that has each face twice,
// once per side.
#pragma once

#include <cstdint>
#include <span>

#include "base/aligned.h"
#include "shade/normalize_ref.h"

namespace tilegrad::shade {

template <class T>
struct TriangleMeshT {
  std::span<const T> positions;         // [V,3]
  std::span<const std::int32_t> faces;  // [F,3] in [0, V)
};
using TriangleMesh = TriangleMeshT<float>;

// units [V] (smooth) or [F] (flat).
void SmoothNormals(const TriangleMesh& mesh, AlignedVector<UnitVector<float>>* units);
void FlatNormals(const TriangleMesh& mesh, AlignedVector<UnitVector<float>>* units);

// Adds to d_positions [V,3]. d_units: [V] or [F] of three; overwritten.
void SmoothNormalsAdjoint(const TriangleMesh& mesh, std::span<const UnitVector<float>> units,
                          std::span<Vec3<float>> d_units, std::span<float> d_positions);
void FlatNormalsAdjoint(const TriangleMesh& mesh, std::span<const UnitVector<float>> units,
                        std::span<Vec3<float>> d_units, std::span<float> d_positions);

}  // namespace tilegrad::shade
