// SPDX-License-Identifier: Apache-2.0
// Fitted meshes as files: what viewers show is what was fitted.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "fit/scene.h"
#include "io/mesh_file.h"
#include "render/picture/picture.h"
#include "scene/shapes.h"
#include "support/temp_folder.h"

namespace tilegrad::train::baked_mesh_test {

constexpr int kSize = 48;

class BakedMesh : public TempFolderTest {
 protected:
  BakedMesh() : sphere_(Icosphere(3, 0.6f)), scene_(SceneOfMesh(sphere_).value()) {
    scene_.cameras = {OrbitCamera({.width = kSize, .height = kSize}, 30, 20, 2)};
  }
  void AddTexture() {
    SetSphereUv(sphere_, &scene_);
    scene_.colors.clear();
    scene_.texture = Image(32, 16, 3);
    for (std::size_t i = 0; i < scene_.texture.pixels.size(); ++i)
      scene_.texture.pixels[i] = 0.5f + 0.5f * std::sin(0.3f * static_cast<float>(i));
  }
  io::LoadedMesh SaveAndLoad() {
    const Path file = folder_ / "mesh.glb";
    EXPECT_TRUE(io::SaveGlb(file, MeshOfScene(scene_)).ok());
    return Ok(io::LoadMesh(file)).value();
  }
  // The largest difference of the fit's picture and the file's, which a viewer lights, where both
  // show the inside of the object.
  float Difference(const Mesh& mesh) {
    const Workers workers(1);
    FitRenderer fit(workers);
    const int view = 0;
    FitRenderer::Job job;
    job.views = {&view, 1};
    job.options.width = job.options.height = kSize;
    EXPECT_TRUE(fit.Render(scene_, job).ok());
    const MeshScene made(mesh, {.color_space = ColorSpace::kSrgb, .filter = Filter::kBilinear});
    Scene lit = made.scene();
    lit.camera = scene_.cameras[0];
    lit.shading.lighting = Lighting::kLambert;
    const Light light = {{0, 1, 0}, 0.8f};
    lit.lights = {&light, 1};
    Picture picture;
    EXPECT_TRUE(
        PictureRenderer(workers).Render(lit, {.width = kSize, .height = kSize}, &picture).ok());
    float largest = 0;
    int shown = 0;
    for (std::size_t i = 0; i < picture.color.size(); ++i) {
      const std::size_t pixel = i % (kSize * kSize);
      if (fit.images().face_ids[pixel] < 0 || picture.alpha[pixel] == 0) continue;
      largest = std::max(largest, std::abs(picture.color[i] - fit.images().color[i]));
      ++shown;
    }
    EXPECT_GT(shown, 1000);
    return largest;
  }

  Mesh sphere_;
  FitScene scene_;
};

TEST_F(BakedMesh, ATextureComesBackUnlitAndAsItWas) {
  AddTexture();
  const auto loaded = SaveAndLoad();
  EXPECT_TRUE(loaded.warnings.empty());
  EXPECT_TRUE(loaded.mesh.materials.at(0).unlit);
  EXPECT_LT(Difference(loaded.mesh), 0.51f / 255 + 1e-4f);  // texels are bytes
}

TEST_F(BakedMesh, VertexColoursComeBackUnlitAndAsTheyWere) {
  for (std::size_t i = 0; i < scene_.colors.size(); ++i)
    scene_.colors[i] = 0.5f + 0.5f * std::sin(static_cast<float>(i));
  const auto loaded = SaveAndLoad();
  EXPECT_TRUE(loaded.mesh.materials.at(0).unlit);
  EXPECT_LT(Difference(loaded.mesh), 1e-4f);
}

// A sphere's are its radii, and the two sides of a seam have the same.
TEST_F(BakedMesh, NormalsAreSmooth) {
  AddTexture();
  const Mesh mesh = SaveAndLoad().mesh;
  ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    EXPECT_GT(glm::dot(mesh.normals[v], glm::normalize(mesh.positions[v])), 0.999f) << v;
}

// Colours that were fitted under a light are those of the surface, and want light.
TEST_F(BakedMesh, WithALightOfItsOwnItIsLit) {
  AddTexture();
  scene_.shading.lighting = Lighting::kSphericalHarmonics;
  const Mesh mesh = SaveAndLoad().mesh;
  EXPECT_FALSE(mesh.materials.at(0).unlit);
  EXPECT_EQ(mesh.normals.size(), mesh.positions.size());
}

}  // namespace tilegrad::train::baked_mesh_test
