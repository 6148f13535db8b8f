// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <vector>

#include "nn/gradient_check.h"
#include "nn/nn.h"
#include "scene/camera.h"
#include "scene/shapes.h"
#include "support/expect.h"
#include "train/models/picture_lookup.h"
#include "train/models/texture_network.h"
#include "train/tasks/textured_image/object_pictures.h"

namespace tilegrad::train::face_cubes_test {

constexpr std::int64_t kSide = 64;

// Bands of latitude and longitude, once around the sphere.
nn::Tensor SmoothMap(nn::Context& context) {
  std::vector<double> texels;
  for (std::int64_t t = 0; t < kSide * kSide; ++t) {
    const double u = (static_cast<double>(t % kSide) + 0.5) / kSide;
    const double v = (static_cast<double>(t / kSide) + 0.5) / kSide;
    const double ring = std::sin(std::numbers::pi * v);
    for (const double turn : {0.0, 1.0, 2.0})
      texels.push_back(0.5 + 0.4 * ring * std::cos(2 * std::numbers::pi * u + turn));
  }
  return context.From({1, kSide, kSide, 3}, std::span<const double>(texels));
}

// A map that varies little within a face comes back, seam and poles included.
TEST(FaceCubes, KeepWhatIsSmooth) {
  const Workers workers(1);
  nn::Context context(workers);
  const FaceCubes cubes(context, Icosphere(3, 0.3f), kSide);
  const nn::Var map = nn::Constant(context, SmoothMap(context));
  const nn::Var of_faces = cubes.Cubes(map);
  EXPECT_EQ(of_faces.shape(), (nn::Shape{1, 1280, 8, 3}));
  const nn::Var back = cubes.Maps(of_faces);
  ASSERT_EQ(back.shape(), map.shape());
  EXPECT_LT(nn::ReduceMax(nn::Abs(back - map), {0, 1, 2, 3}).item(), 0.06);
  EXPECT_LT(nn::Mean(nn::Abs(back - map)).item(), 0.01);
  const nn::Var grey = nn::Constant(context, context.Full({1, kSide, kSide, 3}, 0.25));
  EXPECT_LT(nn::ReduceMax(nn::Abs(cubes.Maps(cubes.Cubes(grey)) - grey), {0, 1, 2, 3}).item(),
            1e-6);
}

// A face has eight numbers: checks of single texels are gone.
TEST(FaceCubes, LoseWhatIsFinerThanAFace) {
  const Workers workers(1);
  nn::Context context(workers);
  const FaceCubes cubes(context, Icosphere(2, 0.3f), kSide);
  std::vector<double> texels;
  for (std::int64_t t = 0; t < kSide * kSide; ++t) {
    for (int c = 0; c < 3; ++c) texels.push_back(static_cast<double>((t + t / kSide) % 2));
  }
  const nn::Var map =
      nn::Constant(context, context.From({1, kSide, kSide, 3}, std::span<const double>(texels)));
  EXPECT_GT(nn::Mean(nn::Abs(cubes.Maps(cubes.Cubes(map)) - map)).item(), 0.3);
}

TEST(FaceLight, IsTheCosineOfOutwardNormals) {
  const Workers workers(1);
  nn::Context context(workers, nn::DType::kF64);
  const Mesh ball = Icosphere(1, 0.5f);
  const std::span<const float> flat(&ball.positions[0].x, 3 * ball.positions.size());
  const auto vertices = static_cast<std::int64_t>(ball.positions.size());
  const nn::Var positions = nn::Parameter(context, context.From({1, vertices, 3}, flat));
  const std::vector<double> direction = {0.6, 0, 0.8};
  const nn::Var light =
      nn::Parameter(context, context.From({1, 3}, std::span<const double>(direction)));
  const nn::Var shade = FaceLight(positions, ball.faces, light, 0.1);
  int dark = 0;
  for (std::size_t f = 0; f < ball.faces.size(); ++f) {
    const auto corner = [&](std::size_t k) {
      return glm::dvec3(ball.positions[static_cast<std::size_t>(ball.faces[f][k])]);
    };
    const glm::dvec3 n = glm::normalize(glm::cross(corner(1) - corner(0), corner(2) - corner(0)));
    const double cosine = 0.6 * n.x + 0.8 * n.z;
    EXPECT_NEAR(shade.value().data<double>()[f], 0.1 + std::max(0.0, cosine), 1e-6);
    dark += cosine < 0 ? 1 : 0;
  }
  EXPECT_GT(dark, 20);
  Rng rng(5);
  const auto loss = [&] {
    return nn::Sum(nn::Square(FaceLight(positions, ball.faces, light, 0.1)));
  };
  nn::ExpectGradientBy({positions, light}, loss, rng);
}

}  // namespace tilegrad::train::face_cubes_test

namespace tilegrad::train::palette_test {

constexpr std::int64_t kSide = 8, kTexels = kSide * kSide;

// Texels of the left half are of one paint, those of the right half of another; of each half
// nothing but the upper rows is lit, by light of a half.
class Palette : public testing::Test {
 protected:
  Palette() : kinds_(2 * kTexels), seen_(12 * kTexels), guess_(3 * kTexels, 0.9f) {
    for (std::int64_t t = 0; t < kTexels; ++t) {
      const bool right = t % kSide >= kSide / 2, lit = t / kSide < 3;
      kinds_[static_cast<std::size_t>(right ? kTexels + t : t)] = 1;
      const float values[6] = {right ? 0.1f : 0.3f, 0.2f, right ? 0.4f : 0.05f, 1, 1, 0.693147f};
      for (std::int64_t c = 0; c < 6; ++c)
        seen_[static_cast<std::size_t>(c * kTexels + t)] = c < 3 && !lit ? 0 : values[c];
    }
  }
  nn::Tensor Colors() {
    const auto map = [&](std::int64_t channels, const std::vector<float>& numbers) {
      return context_.From({1, channels, kSide, kSide}, std::span<const float>(numbers));
    };
    return PaletteColors(nn::Constant(context_, map(2, kinds_)), map(12, seen_),
                         nn::Constant(context_, map(3, guess_)))
        .value();
  }

  Workers workers_{1};
  nn::Context context_{workers_};
  std::vector<float> kinds_, seen_, guess_;
};

// 12 lit texels of weight 1 / 2 beside one guess: (6 * color + 0.9) / 7.
TEST_F(Palette, PaintsTheDarkLikeTheLit) {
  const nn::Tensor colors = Colors();
  const std::int64_t dark_left = 7 * kSide + 1, dark_right = 7 * kSide + 6;
  const auto at = [&](std::int64_t c, std::int64_t t) {
    return colors.data<float>()[c * kTexels + t];
  };
  EXPECT_NEAR(at(0, dark_left), (6 * 0.6 + 0.9) / 7, 1e-3);
  EXPECT_NEAR(at(2, dark_left), (6 * 0.1 + 0.9) / 7, 1e-3);
  EXPECT_NEAR(at(0, dark_right), (6 * 0.2 + 0.9) / 7, 1e-3);
  EXPECT_NEAR(at(2, dark_right), (6 * 0.8 + 0.9) / 7, 1e-3);
}

TEST_F(Palette, GuessesWhereNothingIsLit) {
  std::fill(seen_.begin(), seen_.begin() + 3 * kTexels, 0.0f);
  const nn::Tensor colors = Colors();
  for (const float x : colors.span<float>()) EXPECT_NEAR(x, 0.9, 1e-3);
}

}  // namespace tilegrad::train::palette_test

// Pictures of a ball, whose surface and camera are known, are read back texel by texel.
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
    const auto picture = Ok(pictures.Draw(mesh, view_, appearance));
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
