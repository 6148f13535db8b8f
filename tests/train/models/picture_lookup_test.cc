// SPDX-License-Identifier: Apache-2.0
// Pictures of a ball, whose surface and camera are known, are read back texel by texel.
#include "train/models/picture_lookup.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "nn/nn.h"
#include "scene/camera.h"
#include "scene/light_frame.h"
#include "scene/shapes.h"
#include "train/tasks/textured_image/object_pictures.h"

namespace tilegrad::train::picture_lookup_test {

constexpr int kSize = 64, kSide = 32;

class Lookup : public testing::Test {
 protected:
  Lookup() {
    view_.camera = OrbitCamera<float>({}, 70, 25, 1.6);
    view_.camera.cx += 2;
    view_.camera.cy -= 3;
    view_.light.direction = {0.48f, 0.6f, 0.64f};
  }
  void Draw(const Mesh& mesh, const LightConfig& light, Appearance appearance) {
    ObjectPictures pictures(light, kSize, 2);
    const auto picture = pictures.Draw(mesh, view_, appearance);
    ASSERT_TRUE(picture.ok()) << picture.status().message();
    image_ = context_.From({1, 4, kSize, kSize}, std::span<const float>(*picture));
    const auto vertices = static_cast<std::int64_t>(ball_.positions.size());
    positions_ =
        context_.From({1, vertices, 3},
                      std::span<const float>(&ball_.positions[0].x, 3 * ball_.positions.size()));
    const Pose pose = PoseOf(view_.camera, kSize);
    pose_ = context_.From({1, kPoseNumbers}, std::span<const double>(pose));
  }
  PictureLookup::Job Job() const { return {image_, positions_, pose_}; }

  Workers workers_{2};
  nn::Context context_{workers_};
  Mesh ball_ = Icosphere(3, 0.4f);
  TexturedView view_;
  nn::Tensor image_, positions_, pose_;
};

TEST_F(Lookup, FindsTheColorsOfTheSurface) {
  Mesh painted = ball_;
  for (const glm::vec3& p : ball_.positions) painted.colors.emplace_back(glm::vec3(0.5f) + p, 1);
  ASSERT_NO_FATAL_FAILURE(Draw(painted, {.model = "none"}, Appearance::kTexture));
  const PictureLookup lookup(ball_, kSide);
  const nn::Tensor seen = lookup.Look(context_, Job());
  ASSERT_EQ(seen.shape(), (nn::Shape{1, 12, kSide, kSide}));
  const auto texels = SphereTexels(ball_, kSide, kSide);
  const float* numbers = seen.data<float>();
  int visible = 0, hidden = 0;
  for (std::size_t t = 0; t < kSide * kSide; ++t) {
    const auto at = [&](std::size_t channel) { return numbers[channel * kSide * kSide + t]; };
    hidden += at(4) < 0 ? 1 : 0;
    if (at(4) < 0.4f) continue;
    ++visible;
    glm::vec3 p(0);
    for (std::size_t k = 0; k < 3; ++k)
      p += texels[t].weights[k] * ball_.positions[static_cast<std::size_t>(texels[t].vertices[k])];
    EXPECT_EQ(at(3), 1);
    // A pixel is 0.02 wide; one of a slope of 60 degrees covers twice that.
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(at(c), 0.5f + p[static_cast<int>(c)], 0.04f);
    // Of the mirror image: what is seen where that is.
    const std::size_t j = t % kSide, other = t - j + (kSide + kSide / 2 - 1 - j) % kSide;
    EXPECT_EQ(numbers[9 * kSide * kSide + other], 1);
  }
  EXPECT_GT(visible, 150);
  EXPECT_GT(hidden, 400);
  const nn::Tensor colors = lookup.Colors(context_, Job());
  for (std::size_t i = 0; i < 3 * kSide * kSide; ++i)
    ASSERT_EQ(colors.data<float>()[i], numbers[i]);
}

TEST_F(Lookup, CuesPointToTheLight) {
  Mesh white = ball_;
  for (std::size_t v = 0; v < ball_.positions.size(); ++v) white.colors.emplace_back(1);
  ASSERT_NO_FATAL_FAILURE(Draw(white, {.model = "lambert"}, Appearance::kLit));
  const PictureLookup lookup(ball_, kSide);
  const nn::Tensor cues = lookup.Cues(context_, Job());
  const float* c = cues.data<float>();
  // Normals that a camera sees vary less along its axis than across: there the light is
  // foreshortened.
  const glm::vec2 goes(c[4], c[5]), light(0.48f, 0.6f);
  EXPECT_GT(glm::dot(goes, light) / glm::length(goes) / glm::length(light), 0.98f);
  EXPECT_GT(c[6], 0);
  EXPECT_LT(c[7], 0.98f);  // some is dark
  EXPECT_GT(c[7], 0.5f);
  EXPECT_GT(c[3], 0.2f);
}

// The predicted light's reciprocal, capped, at each texel.
TEST_F(Lookup, TellsTheLightOfEachTexel) {
  ASSERT_NO_FATAL_FAILURE(Draw(ball_, {.model = "none"}, Appearance::kTexture));
  PictureLookup::Job job = Job();
  const std::array<float, 3> direction = {0, 0, 1};  // towards the camera
  job.light = context_.From({1, 3}, std::span<const float>(direction));
  const nn::Tensor seen = PictureLookup(ball_, kSide).Look(context_, job);
  const float* facing = seen.data<float>() + 4 * kSide * kSide;
  const float* unlit = facing + kSide * kSide;
  for (std::size_t t = 0; t < kSide * kSide; ++t) {
    EXPECT_LE(unlit[t], std::log(4.0f) + 1e-6f);
    EXPECT_GE(unlit[t], -1e-6f);
    if (facing[t] < 0.9f) continue;
    EXPECT_NEAR(std::exp(-unlit[t]), 1, 0.3f);
  }
}

TEST_F(Lookup, CamerasComeBackFromTheirNumbers) {
  const Camera back = CameraOf(PoseOf(view_.camera, kSize), kSize);
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(back.rotation[i], view_.camera.rotation[i], 1e-5);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(back.translation[i], view_.camera.translation[i], 1e-4);
  EXPECT_NEAR(back.fx, view_.camera.fx, 1e-3);
  EXPECT_NEAR(back.cx, view_.camera.cx, 1e-4);
  EXPECT_NEAR(back.cy, view_.camera.cy, 1e-4);
  const Camera any = CameraOf({}, kSize);  // a network may say anything
  for (const float x : any.rotation) EXPECT_TRUE(std::isfinite(x));
}

// A network may say anything.
TEST_F(Lookup, SurvivesPosesThatAreNone) {
  ASSERT_NO_FATAL_FAILURE(Draw(ball_, {.model = "none"}, Appearance::kTexture));
  for (const float value : {0.0f, 1e30f, -5.0f}) {
    const std::vector<float> numbers(kPoseNumbers, value);
    pose_ = context_.From({1, kPoseNumbers}, std::span<const float>(numbers));
    const PictureLookup lookup(ball_, kSide);
    const nn::Tensor seen = lookup.Look(context_, Job()), cues = lookup.Cues(context_, Job());
    for (const nn::Tensor* tensor : {&seen, &cues}) {
      for (std::size_t i = 0; i < tensor->elements(); ++i)
        ASSERT_TRUE(std::isfinite(tensor->data<float>()[i]));
    }
  }
}

}  // namespace tilegrad::train::picture_lookup_test
