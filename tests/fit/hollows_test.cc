// SPDX-License-Identifier: Apache-2.0
#include "fit/hull/hollows.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/vec2.hpp>
#include <numbers>
#include <vector>

#include "fit/hull/hollow_shape.h"
#include "fit/hull/hull_mesh.h"
#include "fit/views_fixture.h"
#include "train/metrics/metrics.h"

namespace tilegrad::train::hollows_test {

TEST(CellDistance, IsThatToTheNearestEmptyCell) {
  constexpr std::array<int, 3> kCells = {7, 9, 6};
  const auto at = [&](int i, int j, int k) {
    return static_cast<std::size_t>((i * kCells[1] + j) * kCells[2] + k);
  };
  std::vector<std::uint8_t> full(7 * 9 * 6, 1);
  full[at(2, 7, 3)] = full[at(5, 4, 2)] = 0;
  const auto empty = [&](int i, int j, int k) {
    return i < 0 || j < 0 || k < 0 || i >= kCells[0] || j >= kCells[1] || k >= kCells[2] ||
           full[at(i, j, k)] == 0;
  };
  const std::vector<float> found = DistanceToEmpty(full, kCells, Workers(2));
  for (int i = 0; i < kCells[0]; ++i)
    for (int j = 0; j < kCells[1]; ++j)
      for (int k = 0; k < kCells[2]; ++k) {
        double least = 1e9;
        for (int x = -1; x <= kCells[0]; ++x)
          for (int y = -1; y <= kCells[1]; ++y)
            for (int z = -1; z <= kCells[2]; ++z)
              if (empty(x, y, z)) least = std::min(least, std::hypot(x - i, y - j, z - k));
        EXPECT_NEAR(found[at(i, j, k)], least, 1e-5) << i << ", " << j << ", " << k;
      }
}

class Hollows : public ViewsTest {
 protected:
  FitInput Pictures(const Mesh& mesh) {
    return Views(mesh, {.views = 24, .held_out = 0, .size = 96});
  }
  // The hull, and what is left of it.
  struct Grids {
    ScalarGrid hull, hollow;
  };
  static Grids Carved(const FitInput& input, int workers = 2) {
    auto grid = Ok(Carve(input, {}, Workers(workers)));
    Grids out{*grid, *grid};
    const auto found = Ok(CarveHollows(input, Workers(workers), {}, &out.hollow));
    EXPECT_EQ(*found, out.hull.values != out.hollow.values);
    return out;
  }
  static double Iou(const Mesh& truth, const ScalarGrid& grid) {
    return VoxelIou(*Voxelize(truth, 32), *Voxelize(LevelSet(grid), 32));
  }
};

constexpr glm::vec3 kSize = {0.9f, 0.5f, 0.7f};
constexpr float kWall = 0.05f;

void AddBox(glm::vec3 low, glm::vec3 high, glm::vec4 color, Mesh* mesh) {
  Mesh box = Box(0.5f * (low + high), high - low);
  SetColor(box, color);
  Append(*mesh, box);
}

// Without a lid; each side has a colour of its own, or all are grey.
Mesh OpenBox(bool colored) {
  const auto color = [&](glm::vec4 c) { return colored ? c : glm::vec4(0.7f, 0.7f, 0.7f, 1); };
  const glm::vec3 h = 0.5f * kSize;
  Mesh mesh;
  AddBox(-h, {h.x, -h.y + kWall, h.z}, color({0.9f, 0.8f, 0.2f, 1}), &mesh);
  AddBox(-h, {-h.x + kWall, h.y, h.z}, color({0.8f, 0.2f, 0.2f, 1}), &mesh);
  AddBox({h.x - kWall, -h.y, -h.z}, h, color({0.2f, 0.3f, 0.8f, 1}), &mesh);
  AddBox(-h, {h.x, h.y, -h.z + kWall}, color({0.2f, 0.7f, 0.3f, 1}), &mesh);
  AddBox({-h.x, -h.y, h.z - kWall}, h, color({0.9f, 0.9f, 0.9f, 1}), &mesh);
  return mesh;
}

TEST_F(Hollows, OfAnOpenBoxAreCarved) {
  const Mesh truth = OpenBox(true);
  const Grids grids = Carved(Pictures(truth));
  EXPECT_LT(Iou(truth, grids.hull), 0.5);
  EXPECT_GT(Iou(truth, grids.hollow), 0.7);
}

// Only the shading of the sides and their edges tell.
TEST_F(Hollows, OfAGreyBoxAreCarvedWhereShadingTells) {
  const Mesh truth = OpenBox(false);
  const Grids grids = Carved(Pictures(truth));
  EXPECT_GT(Iou(truth, grids.hollow), 0.7);
}

// A surface around the y axis through rings of (radius, height).
Mesh Turned(const std::vector<glm::vec2>& profile) {
  constexpr int kSegments = 32;
  Mesh mesh;
  for (const glm::vec2 ring : profile) {
    for (int s = 0; s < kSegments; ++s) {
      const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(s) / kSegments;
      mesh.positions.push_back({ring.x * std::cos(angle), ring.y, ring.x * std::sin(angle)});
    }
  }
  for (int r = 0; r + 1 < static_cast<int>(profile.size()); ++r) {
    for (int s = 0; s < kSegments; ++s) {
      const int a = r * kSegments + s, b = r * kSegments + (s + 1) % kSegments;
      mesh.faces.push_back({a, a + kSegments, b});
      mesh.faces.push_back({b, a + kSegments, b + kSegments});
    }
  }
  return mesh;
}

// Few views look down to the floor, none into the belly: the inside follows the outside as deep as
// nothing speaks against it.
TEST_F(Hollows, OfAJarAreAsDeepAsItsWallsAllow) {
  Mesh jar = Turned({{0, -0.35f},
                     {0.25f, -0.35f},
                     {0.4f, -0.05f},
                     {0.32f, 0.25f},
                     {0.32f, 0.35f},
                     {0.28f, 0.35f},
                     {0.28f, 0.25f},
                     {0.36f, -0.05f},
                     {0.21f, -0.3f},
                     {0, -0.3f}});
  for (const glm::vec3& p : jar.positions)
    jar.colors.push_back({0.5f + 0.6f * p.x, 0.4f, 0.5f + 0.6f * p.z, 1});
  const Grids grids = Carved(Pictures(jar));
  EXPECT_LT(Iou(jar, grids.hull), 0.5);
  EXPECT_GT(Iou(jar, grids.hollow), 0.65);
}

TEST_F(Hollows, AreNotInAClosedBox) {
  Mesh box = OpenBox(true);
  AddBox({-0.45f, 0.2f, -0.35f}, {0.45f, 0.25f, 0.35f}, {0.5f, 0.3f, 0.6f, 1}, &box);
  const Grids grids = Carved(Pictures(box));
  EXPECT_EQ(grids.hull.values, grids.hollow.values);
}

// The area's pull would close them.
TEST_F(Hollows, TurnTheDefaultWeightOfTheAreaOff) {
  FitJob job;
  job.config.vertex_colors = true;
  job.input = Pictures(OpenBox(true));
  const auto open = Ok(PrepareFit(job, Workers(2)));
  EXPECT_EQ(open->config.regularizers.area, 0);
}

TEST_F(Hollows, AreTheSameForAnyNumberOfWorkers) {
  const FitInput input = Pictures(OpenBox(true));
  EXPECT_EQ(Carved(input, 1).hollow.values, Carved(input, 5).hollow.values);
}

}  // namespace tilegrad::train::hollows_test
