// SPDX-License-Identifier: Apache-2.0
#include "fit/refine.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "fit/input.h"
#include "fit/views_fixture.h"
#include "render/picture/mesh_pictures.h"
#include "render/picture/mesh_scene.h"

namespace tilegrad::train::refine_test {

constexpr int kSize = 64;

// An ellipsoid with a nose towards +z: symmetric at x = 0, and no two sides look alike. Red below,
// blue above.
Mesh Figure(glm::vec3 radii) {
  Mesh mesh = Icosphere(3, 1);
  for (glm::vec3& p : mesh.positions) {
    const glm::vec4 color =
        p.y < 0 ? glm::vec4(0.8f, 0.2f, 0.1f, 1) : glm::vec4(0.1f, 0.2f, 0.8f, 1);
    const float nose = std::exp(-8 * glm::dot(p - glm::vec3(0, 0, 1), p - glm::vec3(0, 0, 1)));
    mesh.colors.push_back(color);
    p = radii * p + glm::vec3(0, 0, 0.2f * nose);
  }
  EXPECT_TRUE(NormalizeToBox(mesh, 0.45f).ok());
  return mesh;
}

Camera CameraAt(double azimuth) {
  CameraRule rule;
  rule.lens.width = rule.lens.height = kSize;
  return OrbitCamera(rule.lens, azimuth, rule.elevation, rule.distance);
}

TargetImages PictureOf(const Mesh& mesh, const Camera& camera) {
  const auto planar = Ok(LitRenderer().Render(mesh, {&camera, 1}, kSize));
  return TargetsOfPlanar(*planar, kSize);
}

TEST(FindCameras, FindsWhereAPictureWasTaken) {
  const Workers workers(1);
  const Mesh mesh = Figure({0.3f, 0.2f, 0.4f});
  auto scene = Ok(SceneOfMesh(mesh));
  for (const double azimuth : {15.0, 100.0, 290.0}) {
    const auto found =
        Ok(FindCameras(*scene, PictureOf(mesh, CameraAt(azimuth)), CameraRule(), workers));
    const FoundCamera& best = found->front();
    // The nearest of the cameras that are tried is 7.5 degrees away at most.
    EXPECT_LT(std::abs(std::remainder(best.azimuth - azimuth, 360.0)), 7.6) << azimuth;
    EXPECT_EQ(best.elevation, 27) << azimuth;
    EXPECT_GT(best.silhouette_iou, 0.85) << azimuth;
  }
}

TEST(FindCameras, FollowsAPictureThatIsFramedOtherwise) {
  const Workers workers(1);
  const Mesh mesh = Figure({0.3f, 0.2f, 0.4f});
  auto scene = Ok(SceneOfMesh(mesh));
  Camera camera = CameraAt(45);
  camera.translation[0] += 0.15f;
  camera.translation[1] -= 0.1f;
  camera.translation[2] -= 0.4f;
  const auto found = Ok(FindCameras(*scene, PictureOf(mesh, camera), CameraRule(), workers));
  EXPECT_GT(found->front().silhouette_iou, 0.9);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(found->front().camera.translation[i], camera.translation[i], 0.08) << i;
  }
}

TEST(RefineMesh, MovesAPredictionOntoItsPicture) {
  const Workers workers(1);
  const Mesh truth = Figure({0.3f, 0.2f, 0.4f});
  Mesh prediction = Figure({0.4f, 0.35f, 0.4f});
  for (glm::vec4& color : prediction.colors) color = glm::vec4(0.5f, 0.5f, 0.5f, 1);
  const TargetImages picture = PictureOf(truth, CameraAt(30));
  const auto refined = Ok(RefineMesh(prediction, picture, {.steps = 150}, workers));
  EXPECT_LT(refined->before.silhouette_iou, 0.92);
  EXPECT_GT(refined->after.silhouette_iou, 0.95);
  EXPECT_GT(refined->before.color_l1, 0.15);
  EXPECT_LT(refined->after.color_l1, 0.06);
  EXPECT_TRUE(Validate(refined->mesh).ok());
  EXPECT_EQ(refined->mesh.positions.size(), 2562u);  // faces divided once
  // The side that the picture does not show has the colours of the other.
  glm::vec3 left(0), right(0);
  for (std::size_t v = 0; v < refined->mesh.positions.size(); ++v) {
    const glm::vec3 p = refined->mesh.positions[v];
    if (p.y > 0.1f && std::abs(p.x) > 0.15f)
      (p.x < 0 ? left : right) += glm::vec3(refined->mesh.colors[v]);
  }
  EXPECT_GT(left.z, 1.5f * left.x);
  EXPECT_GT(right.z, 1.5f * right.x);
}

TEST(RefineMesh, TheCameraSeesTheMeshThatIsGiven) {
  const Workers workers(1);
  const Mesh truth = Figure({0.3f, 0.2f, 0.4f});
  const TargetImages picture = PictureOf(truth, CameraAt(200));
  for (const int steps : {0, 60}) {
    const auto refined =
        Ok(RefineMesh(Figure({0.35f, 0.3f, 0.4f}), picture, {.steps = steps}, workers));
    auto scene = Ok(SceneOfMesh(refined->mesh));
    scene->cameras = {refined->camera};
    FitRenderer renderer(workers);
    FitRenderer::Job job;
    const int own[] = {0};
    job.views = own;
    job.alpha = false;
    job.options.width = job.options.height = kSize;
    ASSERT_TRUE(renderer.Render(*scene, job).ok());
    std::vector<float> drawn;
    for (const std::int32_t face : renderer.images().face_ids)
      drawn.push_back(face >= 0 ? 1.0f : 0.0f);
    EXPECT_NEAR(MaskIou(drawn, picture.alpha), refined->after.silhouette_iou, 0.03) << steps;
  }
}

// Paint tells the sides of a ball apart; without it nothing does.
TEST(RefineMesh, SaysHowWellAnotherSideFits) {
  const Workers workers(1);
  Mesh plain = Icosphere(3, 0.45f);
  plain.colors.assign(plain.positions.size(), glm::vec4(0.5f, 0.5f, 0.5f, 1));
  Mesh painted = plain;
  for (std::size_t v = 0; v < painted.positions.size(); ++v)
    painted.colors[v] = painted.positions[v].z < 0 ? glm::vec4(0.8f, 0.2f, 0.1f, 1)
                                                   : glm::vec4(0.1f, 0.2f, 0.8f, 1);
  const auto rival = [&](const Mesh& mesh) {
    const auto refined = RefineMesh(mesh, PictureOf(mesh, CameraAt(30)), {.steps = 40}, workers);
    EXPECT_TRUE(refined.ok()) << refined.status().message();
    return refined.ok() ? refined->rival : 0;
  };
  EXPECT_LT(rival(plain), kDoubtfulRival);
  EXPECT_GT(rival(painted), kDoubtfulRival);
}

TEST(RefineMesh, WorkersDoNotChangeTheResult) {
  const TargetImages picture = PictureOf(Figure({0.3f, 0.2f, 0.4f}), CameraAt(30));
  std::vector<Mesh> meshes;
  for (const int count : {1, 2}) {
    const Workers workers(count);
    auto refined = Ok(RefineMesh(Figure({0.4f, 0.35f, 0.4f}), picture, {.steps = 20}, workers));
    meshes.push_back(std::move(refined->mesh));
  }
  EXPECT_EQ(meshes[0].positions, meshes[1].positions);
  EXPECT_EQ(meshes[0].colors, meshes[1].colors);
}

TEST(RefineMesh, APictureWithoutAnObjectIsAnError) {
  const Workers workers(1);
  TargetImages empty;
  empty.width = empty.height = kSize;
  empty.color.resize(3 * empty.pixels());
  empty.alpha.resize(empty.pixels());
  ExpectMessage(RefineMesh(Figure({0.4f, 0.35f, 0.4f}), empty, {.steps = 5}, workers).status(),
                "no object");
}

// A grey map in longitude and latitude takes the picture's colours, on both sides.
TEST(RefineMesh, PaintsATextureMap) {
  const Workers workers(2);
  Mesh mesh = Figure({0.4f, 0.35f, 0.4f});
  mesh.colors.clear();
  mesh.corner_uvs = SphereUvs(Icosphere(3, 1));
  ImageU8 grey(32, 32, 3);
  std::ranges::fill(grey.pixels, std::uint8_t{128});
  mesh.textures = {{"map", grey}};
  mesh.materials = {{.name = "map", .base_color_texture = 0}};
  const TargetImages picture = PictureOf(Figure({0.3f, 0.2f, 0.4f}), CameraAt(30));
  const auto refined = Ok(RefineMesh(mesh, picture, {.steps = 200}, workers));
  EXPECT_GT(refined->after.silhouette_iou, 0.95);
  EXPECT_GT(refined->before.color_l1, 0.15);
  EXPECT_LT(refined->after.color_l1, 0.06);
  EXPECT_TRUE(Validate(refined->mesh).ok());
  EXPECT_EQ(refined->mesh.positions.size(), 2562u);
  EXPECT_TRUE(refined->mesh.colors.empty());
  // Blue above: the first rows of the map, from u = 0 to u = 1.
  const ImageU8& map = refined->mesh.textures[0].image;
  for (int x = 0; x < 32; x += 4) EXPECT_GT(map.at(x, 10)[2], map.at(x, 10)[0]) << x;
}

}  // namespace tilegrad::train::refine_test
