// SPDX-License-Identifier: Apache-2.0
// What the renderer does: only what is asked for, which it can explain.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <string>

#include "render/renderer.h"
#include "render/trial.h"
#include "render/validate.h"
#include "scene/camera.h"
#include "support/expect.h"

namespace tilegrad::renderer_contract_test {

constexpr int kWidth = 150, kHeight = 100;  // several bins and bands
constexpr std::size_t kPixels = kWidth * kHeight;

RenderOptions Options() { return {.width = kWidth, .height = kHeight}; }

// A textured sphere with colours, under `lighting`.
OwnedScene<float> Sphere(Lighting lighting) {
  Rng rng(3, 1);
  OwnedScene<float> s;
  s.mesh = test::BumpySphere(12, 16, kWidth, kHeight, &rng);
  test::RandomAttributes(2, Rate::kVertex, &rng, &s.mesh);
  test::RandomVectors(s.mesh.vertex_count(), 0, 1, 3, &rng, &s.colors);
  test::RandomVectors(s.mesh.faces.size(), 0, 1, 2, &rng, &s.uvs);
  s.textures = {{.texels = {}, .width = 16, .height = 8, .filter = Filter::kTrilinear}};
  test::RandomVectors(128, 0, 1, 3, &rng, &s.textures[0].texels);
  s.surfaces.push_back({{1, 1, 1}, 0, {0.1f, 0.1f, 0.1f}, {1, 1, 1}, {0.4f, 0.4f, 0.4f}, 10});
  s.shading.lighting = lighting;
  if (lighting == Lighting::kSphericalHarmonics) s.sh = {1, 0.5f, 0.2f, 0.1f, 0, 0, 0.3f, 0, 0};
  if (UsesLights(s.shading)) {
    s.lights = {{{1, 1, 1}, 0.7f}, {{-1, 0.5f, 1}, 0.3f}};
  }
  return s;
}

// Nothing but geometry.
OwnedScene<float> Bare() {
  OwnedScene<float> s = Sphere(Lighting::kNone);
  s.colors.clear();
  s.uvs.clear();
  s.textures.clear();
  s.surfaces.clear();
  return s;
}

Outputs Request(bool color, bool alpha) {
  return {.color = color, .alpha = alpha, .attributes = false};
}

std::int64_t Foreground(const Frame& frame) {
  std::int64_t seen = 0;
  for (const std::int32_t id : frame.images().face_ids) seen += id >= 0;
  return seen;
}

// A renderer with one scene.
struct Session {
  Workers workers{2};
  Renderer renderer = RendererOn(workers);
  OwnedScene<float> scene;
  Scene view;
  RenderOptions options = Options();
  Frame frame;

  explicit Session(OwnedScene<float> s) : scene(std::move(s)), view(scene.View()) {}
  PlanReport Render(const Outputs& request) {
    Ok(renderer.Render({&view, 1}, options, request, &frame));
    return Explain(renderer);
  }
  // With the cotangents and gradients that are left after `choose`.
  PlanReport Backward(const std::function<void(FrameGradients&, SceneGradients&)>& choose) {
    Rng rng(4, 4);
    const OwnedCotangents<float> all(kPixels, 2, &rng);
    OwnedGradients<float> gradients(scene);
    FrameGradients d_frame;
    d_frame.color = all.color;
    const SceneGradients every_gradient = gradients.View();
    SceneGradients d_scene;
    chosen = &every_gradient;
    choose(d_frame, d_scene);
    Ok(renderer.Backward(frame, d_frame, {&d_scene, 1}));
    return Explain(renderer);
  }
  const SceneGradients* chosen = nullptr;  // all gradients there are, to choose from
};

TEST(ShadedPlan, SilhouetteTouchesNoAttribute) {
  Session session(Sphere(Lighting::kPhong));
  const PlanReport report = session.Render(Request(false, true));
  for (const char* stage : {"normals", "textures", "pack", "interpolate", "gather", "normalise",
                            "texture", "light", "combine", "scatter"}) {
    EXPECT_EQ(report.count(stage), 0) << stage;
  }
  EXPECT_EQ(report.count("visibility"), 6);
  EXPECT_EQ(report.count("alpha"), 6);
  EXPECT_TRUE(session.frame.images().color.empty());
}

TEST(ShadedPlan, ColoursAloneAreInterpolatedAndNothingElse) {
  Session session(Bare());
  session.scene.colors = Sphere(Lighting::kNone).colors;
  session.view = session.scene.View();
  const PlanReport report = session.Render(Request(true, false));
  for (const char* stage : {"normals", "textures", "pack", "gather", "light", "alpha"}) {
    EXPECT_EQ(report.count(stage), 0) << stage;
  }
  EXPECT_EQ(report.count("interpolate"), 6);
  EXPECT_EQ(session.frame.images().color.size(), 3 * kPixels);
}

TEST(ShadedPlan, UnlitSceneComputesNoNormal) {
  Session session(Sphere(Lighting::kNone));
  const PlanReport report = session.Render(Request(true, true));
  const std::int64_t seen = Foreground(session.frame);
  EXPECT_GT(seen, 1000);
  EXPECT_EQ(report.count("normals"), 0);
  EXPECT_EQ(report.count("normalise"), 0);
  EXPECT_EQ(report.count("light"), 0);
  EXPECT_EQ(report.count("texture"), seen);
  EXPECT_EQ(report.count("combine"), seen);
}

TEST(ShadedPlan, EveryForegroundPixelIsShadedOnce) {
  for (const auto lighting :
       {Lighting::kLambert, Lighting::kPhong, Lighting::kSphericalHarmonics}) {
    Session session(Sphere(lighting));
    const PlanReport report = session.Render(Request(true, false));
    const std::int64_t seen = Foreground(session.frame);
    for (const char* stage : {"gather", "normalise", "texture", "light", "combine", "scatter"}) {
      EXPECT_EQ(report.count(stage), seen) << stage;
    }
    EXPECT_EQ(report.count("normals"), static_cast<std::int64_t>(session.scene.mesh.face_count()));
    EXPECT_EQ(report.count("textures"), 128 + 32 + 8 + 2 + 1);
  }
}

TEST(ShadedPlan, NothingIsPulledThatDoesNotRequireIt) {
  Session session(Sphere(Lighting::kPhong));
  session.Render(Request(true, true));
  const std::int64_t seen = Foreground(session.frame);
  const auto& chosen = session.chosen;
  // A texture pulls on no attribute, and needs all of them again, and the light.
  PlanReport report = session.Backward([&](auto&, auto& d) { d.textures = chosen->textures; });
  EXPECT_EQ(report.count("scatter"), 0);
  EXPECT_EQ(report.count("gradients"), 0);
  EXPECT_EQ(report.count("merge"), 0);
  EXPECT_EQ(report.count("texture"), seen);
  EXPECT_EQ(report.count("recompute"), seen * 8);  // colour, uv, normal; no highlight
  // Colours pull on themselves alone.
  report = session.Backward([&](auto&, auto& d) { d.colors = chosen->colors; });
  EXPECT_EQ(report.count("scatter"), seen * 3);
  EXPECT_EQ(report.count("recompute"), seen * 5);
  // Positions pull on all that is interpolated.
  report = session.Backward([&](auto&, auto& d) { d.positions = chosen->positions; });
  EXPECT_EQ(report.count("scatter"), seen * 11);
  EXPECT_EQ(report.count("recompute"), seen * 11);
  // Alpha alone visits no foreground pixel.
  report = session.Backward([&](auto& d_frame, auto& d) {
    d_frame.color = {};
    d.positions = chosen->positions;
    static const std::vector<float> d_alpha(kPixels, 1.0f);
    d_frame.alpha = d_alpha;
  });
  EXPECT_EQ(report.count("gather"), 0);
  EXPECT_EQ(report.count("recompute"), 0);
  EXPECT_EQ(report.count("alpha"), 6);
  // No gradient at all.
  report = session.Backward([](auto&, auto&) {});
  EXPECT_EQ(report.count("gather"), 0);
  EXPECT_EQ(report.count("merge"), 0);
}

const StageReport& StageOf(const PlanReport& report, std::string_view name) {
  return *std::find_if(report.stages.begin(), report.stages.end(),
                       [&](const StageReport& stage) { return stage.name == name; });
}

TEST(ShadedPlan, AlphaIsNamedByItsRule) {
  const struct {
    AlphaRule rule;
    const char *forward, *backward;
  } rules[] = {
      {AlphaRule::kAllFaces, "equation 6: ", "equation 6, to geometry: "},
      {AlphaRule::kPaper, "the paper's truncated rule", "the paper's truncated rule, to geometry"}};
  const std::vector<float> d_alpha(kPixels, 1.0f);
  for (const auto& [rule, forward, backward] : rules) {
    Session session(Sphere(Lighting::kPhong));
    session.options.alpha_rule = rule;
    PlanReport report = session.Render(Request(false, true));
    EXPECT_TRUE(StageOf(report, "alpha").what.starts_with(forward))
        << StageOf(report, "alpha").what;
    EXPECT_EQ(StageOf(report, "alpha").what.find("pairs") == std::string::npos,
              rule == AlphaRule::kPaper);
    report = session.Backward([&](auto& d_frame, auto& d) {
      d_frame.color = {};
      d_frame.alpha = d_alpha;
      d.positions = session.chosen->positions;
    });
    EXPECT_TRUE(StageOf(report, "alpha").what.starts_with(backward))
        << StageOf(report, "alpha").what;
    report = session.Render(Request(true, false));
    EXPECT_EQ(StageOf(report, "alpha").what, "alpha is not requested");
  }
}

TEST(ShadedPlan, LinesNameEveryStageWithItsCount) {
  Session session(Sphere(Lighting::kPhong));
  const PlanReport report = session.Render(Request(true, true));
  const auto lines = ExplainLines(report);
  ASSERT_EQ(lines.size(), report.stages.size() + 1);
  EXPECT_EQ(lines[0], "forward");
  for (std::size_t i = 0; i < report.stages.size(); ++i) {
    const auto& stage = report.stages[i];
    ExpectIn(lines[i + 1], stage.name, std::to_string(stage.count));
    EXPECT_GE(stage.milliseconds, 0);
    EXPECT_FALSE(stage.what.empty());
  }
}

// Numbers near float's limit: an image is right, or an error says that it overflows.

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
  Status Render(OwnedScene<float>& scene) {
    const Scene view = scene.View();
    return renderer_.Render({&view, 1}, test::TrialOptions(), test::EveryImage(), &frame_);
  }
  SceneParts Parts(const Scene& view) const {
    return *ValidateScenes<float>({&view, 1}, test::TrialOptions(), workers_);
  }
  // On every target.
  void ExpectError(OwnedScene<float> scene, const char* image) {
    for (const std::string target : EveryTarget()) {
      const Status status = Render(scene);
      EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
      ExpectMessage(status, "overflows", image);
    }
  }

  const Workers workers_ = Workers(1);
  Renderer renderer_ = RendererOn(workers_);
  Frame frame_;
};

TEST_F(Overflow, LargeNumbersWhoseProductIsAFloatAreDrawn) {
  auto scene = Triangle(0x1p60f);
  scene.surfaces[0].base_color = {0x1p60f, 1, 1};
  Ok(Render(scene));
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

}  // namespace tilegrad::renderer_contract_test
