// SPDX-License-Identifier: Apache-2.0
#include "raster/project.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/rng.h"
#include "raster/project_ref.h"
#include "support/expect.h"
#include "support/shared_data.h"

namespace tilegrad::raster::project_test {

TEST(Project, AgreesWithTheCamerasOfDibR) {
  TILEGRAD_VECTORS_OR_SKIP(json, "08_cameras.json");
  const auto positions = Numbers<float>(json["points"]);
  const std::vector<std::int32_t> faces = {0, 1, 2};
  constexpr int kSize = 64;
  int checked = 0;
  for (const auto& view : json["dibr_camera_info"]) {
    // At the poles theirs breaks; ours takes the limit.
    if (std::abs(view["elevation_deg"].get<double>()) >= 90) continue;
    const Camera camera = OrbitCamera({49.13434207744484, kSize, kSize}, view["azimuth_deg"],
                                      view["elevation_deg"], view["distance"]);
    ScreenMeshBuffers mesh;
    Project({positions, faces, &camera, false}, kSize, kSize, &mesh);
    for (std::size_t v = 0; v < positions.size() / 3; ++v) {
      const auto& expected = view["points_image"][v];  // NDC, y up
      // Float coordinates of up to 64 pixels after about ten operations: 64 * 10 * eps < 1e-4.
      EXPECT_NEAR(mesh.x[v], (expected[0].get<double>() + 1) * kSize / 2, 1e-4) << view;
      EXPECT_NEAR(mesh.y[v], (1 - expected[1].get<double>()) * kSize / 2, 1e-4) << view;
      EXPECT_NEAR(mesh.depth[v], -view["points_camera"][v][2].get<double>(), 1e-6) << view;
      ++checked;
    }
  }
  EXPECT_GE(checked, 20);
}

struct Points {
  std::vector<float> positions;
  std::vector<std::int32_t> faces;
  Camera camera;
  FaceSource<float> source(bool cull) const { return {positions, faces, &camera, cull}; }
};

Points RandomPoints(std::size_t vertices, std::size_t faces, double distance, Rng* rng) {
  Points out;
  for (std::size_t i = 0; i < 3 * vertices; ++i) {
    out.positions.push_back(static_cast<float>(rng->Uniform(-1, 1)));
  }
  for (std::size_t i = 0; i < 3 * faces; ++i) {
    out.faces.push_back(static_cast<std::int32_t>(rng->Below(vertices)));
  }
  out.camera = OrbitCamera({50.0, 80, 60}, 30, 20, distance);
  out.camera.near_plane = 0.1f;
  return out;
}

TEST(Project, EveryTargetEqualsTheReferenceForAnyCount) {
  Rng rng(1, 1);
  for (std::size_t vertices = 1; vertices <= 40; ++vertices) {
    const Points points = RandomPoints(vertices, 5, 3.5, &rng);
    std::vector<double> positions(points.positions.begin(), points.positions.end());
    const CameraT<double> camera = CameraCast<double>(points.camera);
    ScreenMeshBuffersT<double> truth;
    ProjectRef<double>({positions, points.faces, &camera, false}, 80, 60, &truth);
    for (const std::string target : EveryTarget()) {
      ScreenMeshBuffers mesh;
      Project(points.source(false), 80, 60, &mesh);
      ASSERT_EQ(mesh.x.size(), vertices);
      for (std::size_t v = 0; v < vertices; ++v) {
        EXPECT_NEAR(mesh.x[v], truth.x[v], 1e-4) << target;  // as above
        EXPECT_NEAR(mesh.y[v], truth.y[v], 1e-4) << target;
        EXPECT_NEAR(mesh.depth[v], truth.depth[v], 2e-6) << target;
      }
      EXPECT_EQ(mesh.v2, truth.v2);
    }
  }
}

// Where a face is cut, its two neighbours across the cut edges must be given the same vertex.
TEST(NearClip, SharedEdgesAreCutAtTheSamePoint) {
  Rng rng(2, 1);
  const Points points = RandomPoints(60, 200, 0.8, &rng);
  ScreenMeshBuffers buffers;
  Project(points.source(false), 80, 60, &buffers);
  ASSERT_GT(buffers.clipped.size(), 50u);
  int compared = 0;
  const auto n = static_cast<std::size_t>(buffers.source_vertices);
  for (std::size_t i = 0; i < buffers.clipped.size(); ++i) {
    const auto& clip = buffers.clipped[i];
    EXPECT_GE(buffers.depth[static_cast<std::size_t>(clip.a)], points.camera.near_plane);
    EXPECT_LT(buffers.depth[static_cast<std::size_t>(clip.b)], points.camera.near_plane);
    EXPECT_GE(clip.t, 0);
    EXPECT_LE(clip.t, 1);
    for (std::size_t j = 0; j < i; ++j) {
      if (buffers.clipped[j].a != clip.a || buffers.clipped[j].b != clip.b) continue;
      ++compared;
      EXPECT_EQ(buffers.x[n + i], buffers.x[n + j]);
      EXPECT_EQ(buffers.y[n + i], buffers.y[n + j]);
    }
  }
  EXPECT_GT(compared, 5);
}

TEST(NearClip, FacesKeepTheirOrderAndIdentity) {
  Rng rng(3, 1);
  const Points points = RandomPoints(60, 200, 0.8, &rng);
  ScreenMeshBuffers buffers;
  Project(points.source(false), 80, 60, &buffers);
  const ScreenMesh mesh = buffers.View();
  EXPECT_TRUE(std::is_sorted(mesh.source_face.begin(), mesh.source_face.end()));
  std::vector<int> pieces(200, 0);
  for (std::size_t f = 0; f < mesh.faces(); ++f) {
    ++pieces[static_cast<std::size_t>(mesh.source_face[f])];
    if ((mesh.reject[f] & kFaceBehind) != 0) continue;
    for (int k = 0; k < 3; ++k) {
      EXPECT_GE(mesh.depth[static_cast<std::size_t>(mesh.vertex(f, k))], points.camera.near_plane);
    }
  }
  for (const int count : pieces) EXPECT_TRUE(count == 1 || count == 2);
}

// Scenes need no attributes; empty spans have no element to refer to, which only a sanitizer sees.
TEST(NearClip, AttributesWithoutChannelsAreNotRead) {
  Rng rng(4, 1);
  const Points points = RandomPoints(60, 200, 0.8, &rng);
  ScreenMeshBuffers buffers;
  Project(points.source(false), 80, 60, &buffers);
  ASSERT_TRUE(buffers.View().was_clipped());
  for (const Rate rate : {Rate::kVertex, Rate::kCorner}) {
    AttributeViewT<const float> none;
    none.channels = 0;
    none.rate = rate;
    ClipAttributes<float>(buffers.View(), points.faces, none, {});
    ClipAttributesBackward<float>(buffers.View(), points.faces, none, {}, {}, {});
  }
}

TEST(Project, CullsClockwiseFacesOnlyWhenAsked) {
  const Points points{{-1, -1, 0, 1, -1, 0, 0, 1, 0}, {0, 1, 2, 0, 2, 1}, [] {
                        return OrbitCamera({50.0, 32, 32}, 90, 0, 4);  // looks along -z
                      }()};
  ScreenMeshBuffers mesh;
  Project(points.source(true), 32, 32, &mesh);
  EXPECT_EQ(mesh.reject[0], kFaceDrawn);
  EXPECT_EQ(mesh.reject[1], kFaceCulled);
  Project(points.source(false), 32, 32, &mesh);
  EXPECT_EQ(mesh.reject[1], kFaceDrawn);
}

TEST(Project, OverflowingFacesAreRejected) {
  constexpr float kMost = std::numeric_limits<float>::max();
  Points points{{kMost, 0, 0, 1, 0, 0, 0, 1, 0}, {0, 1, 2}, {}};
  points.camera.translation[0] = kMost;
  points.camera.translation[2] = -2;
  for (const std::string target : EveryTarget()) {
    ScreenMeshBuffers mesh;
    Project(points.source(false), 32, 32, &mesh);
    ASSERT_EQ(mesh.reject.size(), 1u);
    EXPECT_EQ(mesh.reject[0], kFaceOverflow) << target;
  }
}

}  // namespace tilegrad::raster::project_test
