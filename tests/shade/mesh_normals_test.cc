// SPDX-License-Identifier: Apache-2.0
// Normals that are known without a formula. Adjoints: render/renderer_gradients_test.cc.
#include <gtest/gtest.h>

#include <vector>

#include "base/rng.h"
#include "shade/mesh_normals_ref.h"

namespace tilegrad::shade::mesh_normals_test {

// Three faces of a unit cube's corner, at the origin; the one in z = 0 has four times the area.
const std::vector<float> kCorner = {0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, 1, 5, 5, 5};
const std::vector<std::int32_t> kFaces = {0, 1, 2, 0, 2, 3, 0, 3, 1};

TEST(MeshNormals, FlatOnesPointOutOfTheCounterClockwiseSide) {
  AlignedVector<UnitVector<float>> units;
  FlatNormals({kCorner, kFaces}, &units);
  ASSERT_EQ(units.size(), 3u);
  EXPECT_EQ(units[0].unit, (Vec3<float>{0, 0, 1}));
  EXPECT_EQ(units[1].unit, (Vec3<float>{1, 0, 0}));
  EXPECT_EQ(units[2].unit, (Vec3<float>{0, 1, 0}));
}

TEST(MeshNormals, SmoothOnesAreWeightedByArea) {
  AlignedVector<UnitVector<float>> units;
  SmoothNormals({kCorner, kFaces}, &units);
  ASSERT_EQ(units.size(), 5u);
  // Twice the areas are 4, 2, 2.
  const float length = std::sqrt(24.0f);
  EXPECT_FLOAT_EQ(units[0].unit[0], 2 / length);
  EXPECT_FLOAT_EQ(units[0].unit[1], 2 / length);
  EXPECT_FLOAT_EQ(units[0].unit[2], 4 / length);
  EXPECT_EQ(units[4].unit, (Vec3<float>{0, 0, 0}));  // no face
}

TEST(MeshNormals, FaceWithoutAreaHasNoNormalAndPullsNothing) {
  const std::vector<std::int32_t> faces = {0, 1, 1};
  AlignedVector<UnitVector<float>> units;
  FlatNormals({kCorner, faces}, &units);
  EXPECT_EQ(units[0].unit, (Vec3<float>{0, 0, 0}));
  std::vector<Vec3<float>> d_units = {{1, 2, 3}};
  std::vector<float> d_positions(kCorner.size());
  FlatNormalsAdjoint({kCorner, faces}, units, d_units, d_positions);
  for (const float d : d_positions) EXPECT_EQ(d, 0);
}

TEST(MeshNormals, TinyMeshesHaveTheNormalsOfLargeOnes) {
  std::vector<float> tiny = kCorner;
  for (float& p : tiny) p *= 0x1p-30f;
  AlignedVector<UnitVector<float>> units, expected;
  SmoothNormals({tiny, kFaces}, &units);
  SmoothNormals({kCorner, kFaces}, &expected);
  for (std::size_t v = 0; v < units.size(); ++v) EXPECT_EQ(units[v].unit, expected[v].unit) << v;
}

// Both sides of a sheet as faces of the same vertices, which start at any corner: what is left of
// the sum is rounding, and would be a direction of no meaning with a gradient without bound.
template <class T>
void ExpectNoNormalOfBothSides(const std::vector<std::int32_t>& back) {
  Rng rng(7, 2);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<T> positions(12);
    for (T& p : positions) p = static_cast<T>(rng.Uniform(-1, 1) + (trial % 3) * 10);
    std::vector<std::int32_t> faces = {0, 1, 2, 2, 1, 3};
    faces.insert(faces.end(), back.begin(), back.end());
    std::vector<UnitVector<T>> units(4);
    const TriangleMeshT<T> mesh{positions, faces};
    SmoothNormalsRef<T>(mesh, units);
    std::vector<Vec3<T>> d_units(4, Vec3<T>{1, 2, 3});
    std::vector<T> d_positions(positions.size());
    SmoothNormalsAdjointRef<T>(mesh, units, d_units, d_positions);
    for (const auto& u : units) EXPECT_EQ(u.unit, (Vec3<T>{0, 0, 0})) << trial;
    for (const T d : d_positions) EXPECT_EQ(d, 0) << trial;
    faces.resize(6);
    SmoothNormalsRef<T>({positions, faces}, units);
    for (const auto& u : units) EXPECT_NEAR(Dot(u.unit, u.unit), 1, 1e-6) << trial;
  }
}

TEST(MeshNormals, BothSidesOfASheetHaveNoSmoothNormal) {
  for (const std::vector<std::int32_t>& back :
       {std::vector<std::int32_t>{0, 2, 1, 2, 3, 1}, {1, 0, 2, 1, 2, 3}, {2, 1, 0, 3, 1, 2}}) {
    ExpectNoNormalOfBothSides<float>(back);
    ExpectNoNormalOfBothSides<double>(back);
  }
}

}  // namespace tilegrad::shade::mesh_normals_test
