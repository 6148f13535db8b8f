// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "fit/hull/hull_mesh.h"
#include "fit/hull/mask_distance.h"
#include "fit/views_fixture.h"
#include "scene/simplify.h"
#include "scene/topology.h"
#include "train/metrics/metrics.h"

namespace tilegrad::train::hull_test {

TEST(MaskDistance, IsThatToADiscsOutlineUpToAFractionOfAPixel) {
  constexpr int kSize = 48;
  constexpr float kRadius = 15.3f, kX = 22.4f, kY = 25.1f;
  const auto inside = [&](float x, float y) { return kRadius - std::hypot(x - kX, y - kY); };
  std::vector<float> alpha;
  for (int y = 0; y < kSize; ++y)
    for (int x = 0; x < kSize; ++x)
      alpha.push_back(std::clamp(
          0.5f + inside(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f), 0.0f, 1.0f));
  const MaskDistance distance = DistanceOf(alpha, kSize, kSize);
  for (float y = 0.5f; y < kSize; y += 1.7f)
    for (float x = 0.5f; x < kSize; x += 1.3f)
      EXPECT_NEAR(distance.At(x, y), inside(x, y), 0.3f) << x << ", " << y;
  EXPECT_NEAR(distance.At(-10, kY), inside(0.5f, kY) - 10.5f, 0.3f);  // beyond the border
}

TEST(MaskDistance, WithoutAnOutlineIsFarEverywhere) {
  const std::vector<float> full(12, 1.0f), empty(12, 0.0f);
  EXPECT_GE(DistanceOf(full, 4, 3).At(2, 2), 1e5f);
  EXPECT_LE(DistanceOf(empty, 4, 3).At(2, 2), -1e5f);
  EXPECT_GE(DistanceOf(full, 4, 3).At(-3, 2), 1e5f);  // cut by the border: may go on
}

TEST(MaskDistance, OfNoPlaceIsFarOutside) {
  const std::vector<float> alpha(12, 1.0f);
  for (const float wild : {NAN, HUGE_VALF, -HUGE_VALF}) {
    EXPECT_EQ(DistanceOf(alpha, 4, 3).At(wild, 1), -HUGE_VALF);
    EXPECT_EQ(DistanceOf(alpha, 4, 3).At(1, wild), -HUGE_VALF);
  }
  EXPECT_LT(DistanceOf(std::vector<float>{1, 0}, 2, 1).At(3e38f, -3e38f), -1e38f);
}

class Hull : public ViewsTest {
 protected:
  FitInput Pictures(const Mesh& mesh, int size = 96) {
    return Views(mesh, {.views = 24, .held_out = 0, .size = size});
  }
  static long Euler(const Mesh& mesh) {
    const auto edges = BuildTopology(mesh.faces, mesh.positions.size()).edges.size();
    return static_cast<long>(mesh.positions.size()) - static_cast<long>(edges) +
           static_cast<long>(mesh.faces.size());
  }
};

TEST_F(Hull, ContainsTheObjectAndIsLittleLarger) {
  const Mesh box = Box({0, 0, 0}, {0.9f, 0.5f, 0.6f});
  const FitInput input = Pictures(box);
  const Workers workers(2);
  const auto grid = Ok(Carve(input, {}, workers));
  int inside = 0, missing = 0, more = 0;
  for (int i = 0; i < grid->size[0]; ++i)
    for (int j = 0; j < grid->size[1]; ++j)
      for (int k = 0; k < grid->size[2]; ++k) {
        const glm::vec3 p = glm::abs(grid->low + grid->cell * glm::vec3(i, j, k));
        const bool in = p.x < 0.45f && p.y < 0.25f && p.z < 0.3f;
        const bool kept = grid->values[grid->At(i, j, k)] > 0;
        inside += in;
        missing += in && !kept;
        more += kept && !in;
      }
  EXPECT_EQ(missing, 0);
  EXPECT_LT(more, inside / 4);
}

// Two rings of four bars: what a sphere cannot become.
TEST_F(Hull, HasTheHolesAndThePartsOfTheObject) {
  Mesh mesh;
  for (const float x : {-0.26f, 0.26f}) {
    for (const float side : {-0.18f, 0.18f}) {
      Append(mesh, Box({x, side, 0}, {0.46f, 0.08f, 0.1f}));
      Append(mesh, Box({x + side, 0, 0}, {0.08f, 0.44f, 0.1f}));
    }
  }
  const auto hull = Ok(HullMesh(Pictures(mesh), {}, Workers(2)));
  EXPECT_EQ(Euler(*hull), 0);
  const auto truth = Voxelize(mesh, 32), found = Voxelize(*hull, 32);
  EXPECT_GT(VoxelIou(*truth, *found), 0.7);
  EXPECT_TRUE(EditMesh::Make(hull->positions, hull->faces).ok());
}

// A long focal length makes pixels, and with them cells, far smaller than what the masks show.
TEST_F(Hull, HasNoMoreCellsThanImagesResolve) {
  FitInput input = Pictures(Box({0, 0, 0}, {0.9f, 0.5f, 0.6f}), 16);
  for (Camera& camera : input.cameras) camera.fx *= 100;
  const auto grid = Ok(Carve(input, {.cell_pixels = 0.5}, Workers(1)));
  EXPECT_LT(*std::max_element(grid->size.begin(), grid->size.end()), 2 * 16 / 0.5 + 9);
}

// No faces hold no handle: a ring has one, a box none.
TEST_F(Hull, HasLargerCellsWhereItHasTooManyHandles) {
  const Workers workers(2);
  HullOptions no_faces;
  no_faces.most_faces = 0;
  const FitInput ring = Pictures(Torus(0.3f, 0.12f, 24, 12), 64);
  const auto fine = Ok(HullMesh(ring, {}, workers)), few = Ok(HullMesh(ring, no_faces, workers));
  const double cell = CarveOptions().cell_pixels;
  const auto coarse = Ok(HullMesh(ring, {.carve = {.cell_pixels = 2 * cell}}, workers));
  EXPECT_EQ(few->positions, coarse->positions);
  EXPECT_EQ(few->faces, coarse->faces);
  EXPECT_NE(few->positions, fine->positions);
  const FitInput box = Pictures(Box({0, 0, 0}, {0.9f, 0.5f, 0.6f}), 64);
  const auto plain = Ok(HullMesh(box, {}, workers)), none = Ok(HullMesh(box, no_faces, workers));
  EXPECT_EQ(plain->positions, none->positions);
}

TEST_F(Hull, IsTheSameForAnyNumberOfWorkers) {
  const FitInput input = Pictures(Torus(0.3f, 0.12f, 24, 12), 64);
  const auto one = Ok(HullMesh(input, {}, Workers(1))), many = Ok(HullMesh(input, {}, Workers(5)));
  EXPECT_EQ(one->positions, many->positions);
  EXPECT_EQ(one->faces, many->faces);
}

// Two of 24 masks are empty: without tolerance nothing is left, with it all but what they forgive.
TEST_F(Hull, ToleratesBadMasks) {
  FitInput input = Pictures(Box({0, 0, 0}, {0.9f, 0.5f, 0.6f}), 64);
  const std::size_t plane = input.images.pixels();
  for (const std::size_t v : {3u, 11u})
    std::fill_n(input.images.alpha.begin() + static_cast<std::ptrdiff_t>(v * plane), plane, 0.0f);
  const auto strict = Carve(input, {}, Workers(1));
  EXPECT_EQ(strict.status().code(), StatusCode::kInvalidArgument);
  ExpectMessage(strict.status(), "--mask-tolerance", "--start sphere");
  const auto hull = Ok(HullMesh(input, {.carve = {.tolerance = 0.1}}, Workers(1)));
  EXPECT_GT(VoxelIou(*Voxelize(*hull, 32), *Voxelize(Box({0, 0, 0}, {0.9f, 0.5f, 0.6f}), 32)),
            0.75);
}

}  // namespace tilegrad::train::hull_test
