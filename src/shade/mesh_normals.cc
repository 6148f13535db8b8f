// SPDX-License-Identifier: Apache-2.0
#include "shade/mesh_normals.h"

#include "shade/mesh_normals_ref.h"

namespace tilegrad::shade {

void SmoothNormals(const TriangleMesh& mesh, AlignedVector<UnitVector<float>>* units) {
  units->resize(mesh.positions.size() / 3);
  SmoothNormalsRef<float>(mesh, *units);
}

void FlatNormals(const TriangleMesh& mesh, AlignedVector<UnitVector<float>>* units) {
  units->resize(mesh.faces.size() / 3);
  FlatNormalsRef<float>(mesh, *units);
}

void SmoothNormalsAdjoint(const TriangleMesh& mesh, std::span<const UnitVector<float>> units,
                          std::span<Vec3<float>> d_units, std::span<float> d_positions) {
  SmoothNormalsAdjointRef<float>(mesh, units, d_units, d_positions);
}

void FlatNormalsAdjoint(const TriangleMesh& mesh, std::span<const UnitVector<float>> units,
                        std::span<Vec3<float>> d_units, std::span<float> d_positions) {
  FlatNormalsAdjointRef<float>(mesh, units, d_units, d_positions);
}

}  // namespace tilegrad::shade
