// SPDX-License-Identifier: Apache-2.0
// Numbers near float's limit: an image is right, or an error says that it overflows.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "base/simd_target.h"
#include "render/renderer.h"
#include "render/trial.h"
#include "render/validate.h"
#include "scene/camera.h"

namespace tilegrad::overflow_test {

constexpr float kMost = std::numeric_limits<float>::max();

// One triangle over the whole image, every colour `color`.
OwnedScene<float> Triangle(float color) {
  OwnedScene<float> s;
  s.mesh.positions = {-9, -9, 0, 9, -9, 0, 0, 9, 0};
  s.mesh.faces = {0, 1, 2};
  s.mesh.channels = 0;
  Lens lens;
  lens.width = test::kTrialWidth;
  lens.height = test::kTrialHeight;
  s.mesh.camera = OrbitCamera(lens, 90, 0, 3);
  s.colors.assign(9, color);
  s.surfaces.resize(1);
  return s;
}

class Overflow : public testing::Test {
 protected:
  void TearDown() override { ASSERT_TRUE(ForceTarget("").ok()); }

  Status Render(OwnedScene<float>& scene) {
    const Scene view = scene.View();
    return renderer_.Render({&view, 1}, test::TrialOptions(), test::EveryImage(), &frame_);
  }
  SceneParts Parts(const Scene& view) const {
    return *ValidateScenes<float>({&view, 1}, test::TrialOptions(), workers_);
  }
  // On every target.
  void ExpectError(OwnedScene<float> scene, const char* image) {
    for (const std::string& target : RunnableTargets()) {
      ASSERT_TRUE(ForceTarget(target).ok());
      const Status status = Render(scene);
      EXPECT_EQ(status.code(), StatusCode::kInvalidArgument) << target;
      for (const char* part : {"overflows", image}) {
        EXPECT_NE(status.message().find(part), std::string::npos) << status.message();
      }
    }
  }

  const Workers workers_ = Workers(1);
  Renderer renderer_ = RendererOn(workers_);
  Frame frame_;
};

TEST_F(Overflow, LargeNumbersWhoseProductIsAFloatAreDrawn) {
  auto scene = Triangle(0x1p60f);
  scene.surfaces[0].base_color = {0x1p60f, 1, 1};
  const Status status = Render(scene);
  ASSERT_TRUE(status.ok()) << status.message();
  int seen = 0;
  for (std::size_t i = 0; i < test::kTrialPixels; ++i) {
    if (frame_.images().face_ids[i] < 0) continue;
    EXPECT_NEAR(frame_.images().color[i], 0x1p120f, 0x1p120f * 1e-6f);
    ++seen;
  }
  EXPECT_GT(seen, 20);
}

TEST_F(Overflow, ColoursTimesBaseColours) {
  auto scene = Triangle(0x1p100f);
  scene.surfaces[0].base_color = {1, 0x1p100f, 1};
  ExpectError(scene, "color[");
}

TEST_F(Overflow, Texels) {
  auto scene = Triangle(1);
  scene.uvs = {0, 0, 1, 0, 0, 1};  // of corners
  scene.textures.resize(1);
  scene.textures[0].width = scene.textures[0].height = 1;
  scene.textures[0].texels = {kMost, 1, 1};
  scene.surfaces[0].texture = 0;
  scene.surfaces[0].base_color = {2, 1, 1};
  ExpectError(scene, "color[");
}

TEST_F(Overflow, Coefficients) {
  auto scene = Triangle(1);
  scene.shading.lighting = Lighting::kSphericalHarmonics;
  scene.sh.assign(9, kMost);
  scene.surfaces[0].base_color = {9, 9, 9};
  ExpectError(scene, "color[");
}

TEST_F(Overflow, Lights) {
  for (const Lighting lighting : {Lighting::kLambert, Lighting::kPhong}) {
    auto scene = Triangle(1);
    scene.shading.lighting = lighting;
    scene.shading.two_sided = true;
    scene.lights = {
        {{0, 0, 1}, kMost}, {{0, 0, 1}, kMost}, {{0, 0, -1}, kMost}, {{0, 0, -1}, kMost}};
    ExpectError(scene, "color[");
  }
}

// Beside the gradients, which are checked anyway.
TEST_F(Overflow, OrdinaryNumbersAreNotLookedThrough) {
  auto scene = Triangle(0x1p20f);
  const Scene view = scene.View();
  ASSERT_TRUE(Render(scene).ok());
  EXPECT_FALSE(Parts(view).may_overflow);
  scene.colors[4] = 0x1.1p20f;
  EXPECT_TRUE(Parts(view).may_overflow);
}

}  // namespace tilegrad::overflow_test
