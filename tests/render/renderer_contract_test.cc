// SPDX-License-Identifier: Apache-2.0
// What engine.h promises besides numbers: only what is asked for, same bits, no
// allocation, sums over scenes that share an array, errors.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>

#include "render/engine.h"
#include "render/trial.h"
#include "support/allocation_count.h"

namespace tilegrad::renderer_contract_test {

using test::g_allocations;
using test::SceneRecipe;

constexpr int kWidth = 150, kHeight = 100;  // several bins and bands
constexpr std::size_t kPixels = kWidth * kHeight;

RenderOptions Options() {
  RenderOptions options;
  options.width = kWidth, options.height = kHeight;
  return options;
}

// A textured sphere with colours, under `lighting`.
OwnedScene<float> Sphere(Lighting lighting, std::uint64_t seed = 3) {
  Rng rng(seed, 1);
  OwnedScene<float> s;
  s.mesh = test::BumpySphere(12, 16, kWidth, kHeight, &rng);
  test::RandomAttributes(2, Rate::kVertex, &rng, &s.mesh);
  test::RandomVectors(s.mesh.vertex_count(), 0, 1, 3, &rng, &s.colors);
  test::RandomVectors(s.mesh.faces.size(), 0, 1, 2, &rng, &s.uvs);
  s.textures.resize(1);
  auto& t = s.textures[0];
  t.width = 16, t.height = 8, t.filter = Filter::kTrilinear;
  test::RandomVectors(128, 0, 1, 3, &rng, &t.texels);
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
  s.colors.clear(), s.uvs.clear(), s.textures.clear(), s.surfaces.clear();
  return s;
}

Outputs Request(bool color, bool alpha) {
  Outputs request;
  request.color = color, request.alpha = alpha, request.attributes = false;
  return request;
}

std::int64_t Foreground(const PipelineFrame& frame) {
  std::int64_t seen = 0;
  for (const std::int32_t id : frame.face_ids) seen += id >= 0;
  return seen;
}

// A renderer with one scene.
struct Session {
  Workers workers{2};
  Engine renderer{workers};
  OwnedScene<float> scene;
  Scene view;
  RenderOptions options = Options();
  FrameImages frame;

  explicit Session(OwnedScene<float> s) : scene(std::move(s)), view(scene.View()) {}
  PlanReport Render(const Outputs& request) {
    const Status status = renderer.Render({&view, 1}, options, request, &frame);
    EXPECT_TRUE(status.ok()) << status.message();
    return renderer.Explain();
  }
  // With the cotangents and gradients that are left after `choose`.
  PlanReport Backward(const std::function<void(FrameGradients&, SceneGradients&)>& choose) {
    Rng rng(4, 4);
    const OwnedCotangents<float> all(kPixels, 2, &rng);
    OwnedGradients<float> gradients(scene);
    auto d_frame = all.View();
    d_frame.uv = {}, d_frame.normals = {}, d_frame.depth = {}, d_frame.attributes = {};
    d_frame.alpha = {};
    const SceneGradients every_gradient = gradients.View();
    SceneGradients d_scene;
    chosen = &every_gradient;
    choose(d_frame, d_scene);
    const Status status = renderer.Backward({&view, 1}, options, frame, d_frame, {&d_scene, 1});
    EXPECT_TRUE(status.ok()) << status.message();
    return renderer.Explain();
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
  EXPECT_TRUE(session.frame.color.empty());
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
  EXPECT_EQ(session.frame.color.size(), 3 * kPixels);
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
    d_frame.color = {}, d.positions = chosen->positions;
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
      d_frame.color = {}, d_frame.alpha = d_alpha, d.positions = session.chosen->positions;
    });
    EXPECT_TRUE(StageOf(report, "alpha").what.starts_with(backward))
        << StageOf(report, "alpha").what;
    report = session.Render(Request(true, false));
    EXPECT_EQ(StageOf(report, "alpha").what, "alpha is not wanted");
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
    EXPECT_NE(lines[i + 1].find(stage.name), std::string::npos);
    EXPECT_NE(lines[i + 1].find(std::to_string(stage.count)), std::string::npos);
    EXPECT_GE(stage.milliseconds, 0);
    EXPECT_FALSE(stage.what.empty());
  }
}

// Two scenes, all images, all gradients; each with its own arrays, or sharing those of the first.
struct Pair {
  OwnedScene<float> scenes[2];
  OwnedCotangents<float> d_frame;

  explicit Pair(Lighting lighting) {
    scenes[0] = Sphere(lighting);
    scenes[1] = scenes[0];
    scenes[1].mesh.camera = OrbitCamera({45.0, kWidth, kHeight}, 200, 10, 2.2);
    Rng rng(8, 8);
    d_frame = OwnedCotangents<float>(2 * kPixels, 2, &rng);
  }

  // All numbers of the gradients, of scene 0 then 1; `shared`: all go to those of scene 0.
  std::vector<float> Run(Engine* renderer, bool shared, FrameImages* frame) {
    Scene views[2] = {scenes[0].View(), scenes[shared ? 0 : 1].View()};
    views[1].camera = scenes[1].mesh.camera;
    EXPECT_TRUE(renderer->Render(views, Options(), test::EveryImage(), frame).ok());
    OwnedGradients<float> gradients[2] = {OwnedGradients<float>(scenes[0]),
                                          OwnedGradients<float>(scenes[1])};
    SceneGradients d[2] = {gradients[0].View(), gradients[shared ? 0 : 1].View()};
    d[1].camera = &gradients[1].d.mesh.camera;
    EXPECT_TRUE(renderer->Backward(views, Options(), *frame, d_frame.View(), d).ok());
    std::vector<float> out;
    for (int n = 0; n < 2; ++n) {
      ForEachNumber(gradients[n].d, [&](const char*, float v) { out.push_back(v); });
    }
    return out;
  }
};

template <class T>
bool SameBits(const T& a, const T& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])) == 0;
}

TEST(ShadedBits, SameForAnyWorkerCountAndRun) {
  for (const auto lighting : {Lighting::kPhong, Lighting::kSphericalHarmonics}) {
    Pair pair(lighting);
    FrameImages first;
    std::vector<float> first_gradients;
    for (const int count : {1, 2, 7}) {
      const Workers workers(count);
      Engine renderer(workers);
      for (int run = 0; run < 2; ++run) {
        FrameImages frame;
        const auto gradients = pair.Run(&renderer, true, &frame);
        if (first.color.empty()) first = frame, first_gradients = gradients;
        EXPECT_TRUE(SameBits(frame.color, first.color)) << count;
        EXPECT_TRUE(SameBits(frame.normals, first.normals)) << count;
        EXPECT_TRUE(SameBits(gradients, first_gradients)) << count;
      }
    }
  }
}

TEST(ShadedGradientArrays, ScenesThatShareAnArrayGetTheSum) {
  Pair pair(Lighting::kPhong);
  const Workers workers(2);
  Engine renderer(workers);
  FrameImages frame;
  const auto apart = pair.Run(&renderer, false, &frame);
  const auto together = pair.Run(&renderer, true, &frame);
  const std::size_t count = apart.size() / 2, camera = 16;  // cameras are never shared
  double largest = 0;
  for (std::size_t i = 0; i < count; ++i) largest = std::max(largest, std::abs(1.0 * apart[i]));
  ASSERT_GT(largest, 0);
  for (std::size_t i = 0; i < count; ++i) {
    const bool own = i >= count - camera;
    const float expected = own ? apart[i] : apart[i] + apart[count + i];
    // Texels are summed over both scenes without a stop between them.
    EXPECT_NEAR(together[i], expected, 1e-5 * (std::abs(expected) + 1)) << i;
  }
}

TEST(ShadedMemory, SteadyStateAllocatesNothing) {
  for (const auto lighting :
       {Lighting::kLambert, Lighting::kPhong, Lighting::kSphericalHarmonics}) {
    OwnedScene<float> scene = Sphere(lighting);
    const Scene view = scene.View();
    Rng rng(1, 2);
    const OwnedCotangents<float> d_frame(kPixels, 2, &rng);
    OwnedGradients<float> gradients(scene);
    SceneGradients d_scene = gradients.View();
    const Workers workers(1);
    Engine renderer(workers);
    FrameImages frame;
    const auto step = [&] {
      ASSERT_TRUE(renderer.Render({&view, 1}, Options(), test::EveryImage(), &frame).ok());
      ASSERT_TRUE(
          renderer.Backward({&view, 1}, Options(), frame, d_frame.View(), {&d_scene, 1}).ok());
    };
    const long before_first = g_allocations;
    step();
    EXPECT_GT(g_allocations, before_first);  // the counter counts
    const long before = g_allocations;
    for (int i = 0; i < 3; ++i) step();
    EXPECT_EQ(g_allocations - before, 0);
  }
}

struct BadScene {
  const char* name;
  std::function<void(OwnedScene<float>&)> spoil;
  const char* says;
};

const BadScene kBadScenes[] = {
    {"short_colors", [](auto& s) { s.colors.pop_back(); }, "colors must be"},
    {"nan_color", [](auto& s) { s.colors[4] = NAN; }, "colors[4] is nan"},
    {"short_uvs", [](auto& s) { s.uvs.pop_back(); }, "uvs must be"},
    {"no_uvs", [](auto& s) { s.uvs.clear(); }, "no uvs"},
    {"short_texture", [](auto& s) { s.textures[0].texels.pop_back(); }, "textures[0]: texels"},
    {"no_texels", [](auto& s) { s.textures[0].width = 0; }, "textures[0]: is 0 x 8"},
    {"texture_index", [](auto& s) { s.surfaces[0].texture = 3; }, "surfaces[0]: texture is 3"},
    {"shininess", [](auto& s) { s.surfaces[0].shininess = -1; }, "shininess is -1"},
    {"face_surfaces", [](auto& s) { s.face_surfaces.assign(s.mesh.face_count(), 1); },
     "face_surfaces[0] is 1"},
    {"no_lights", [](auto& s) { s.lights.clear(); }, "neither"},
    {"inf_light", [](auto& s) { s.lights[1].direction[2] = INFINITY; }, "lights[1]"},
    // What the shading does not use is looked at, too.
    {"unused_sh", [](auto& s) { s.sh.assign(9, NAN); }, "sh[0] is nan"},
    {"unused_normal", [](auto& s) { s.normals.assign(3 * s.mesh.vertex_count(), NAN); },
     "normals[0] is nan"},
    {"unused_light",
     [](auto& s) {
       s.shading.lighting = Lighting::kNone;
       s.lights[1].intensity = NAN;
     },
     "lights[1]"},
    {"unused_light_direction",
     [](auto& s) {
       s.shading.lighting = Lighting::kNone;
       s.light_directions.assign(3 * s.mesh.vertex_count(), INFINITY);
     },
     "light_directions[0] is inf"},
    {"face", [](auto& s) { s.mesh.faces[7] = 100000; }, "faces[7] is 100000"},
    {"no_normals", [](auto& s) { s.shading.normals = Normals::kGiven; }, "no normals"},
    {"sh",
     [](auto& s) {
       s.shading.lighting = Lighting::kSphericalHarmonics;
       s.sh.assign(4, 1.0f);
     },
     "sh has 4"},
};

TEST(ShadedErrors, NameWhatIsWrong) {
  const Workers workers(1);
  Engine renderer(workers);
  for (const BadScene& bad : kBadScenes) {
    OwnedScene<float> scene = Sphere(Lighting::kPhong);
    bad.spoil(scene);
    const Scene view = scene.View();
    FrameImages frame;
    const Status status = renderer.Render({&view, 1}, Options(), {}, &frame);
    ASSERT_FALSE(status.ok()) << bad.name;
    EXPECT_NE(status.message().find(bad.says), std::string::npos)
        << bad.name << ": " << status.message();
    EXPECT_NE(status.message().find("scene 0"), std::string::npos) << status.message();
  }
}

TEST(ShadedErrors, ScenesOfABatchMustAgree) {
  OwnedScene<float> a = Sphere(Lighting::kPhong), b = Sphere(Lighting::kLambert);
  const Scene views[] = {a.View(), b.View()};
  const Workers workers(1);
  Engine renderer(workers);
  FrameImages frame;
  const Status status = renderer.Render(views, Options(), {}, &frame);
  ASSERT_FALSE(status.ok());
  EXPECT_NE(status.message().find("scene 1"), std::string::npos) << status.message();
}

// A sphere under Phong's light, and the frame of what is asked of it.
class ShadedErrorsOfPhong : public ::testing::Test {
 protected:
  Status Render(const Scene& view, const Outputs& request = {}) {
    return renderer_.Render({&view, 1}, Options(), request, &frame_);
  }
  Status Backward(const Scene& view, const FrameGradients& d_frame, SceneGradients* d_scene) {
    return renderer_.Backward({&view, 1}, Options(), frame_, d_frame, {d_scene, 1});
  }

  OwnedScene<float> scene_ = Sphere(Lighting::kPhong);
  const Workers workers_ = Workers(1);
  Engine renderer_ = Engine(workers_);
  FrameImages frame_;
};

TEST_F(ShadedErrorsOfPhong, CotangentsAreChecked) {
  const Scene view = scene_.View();
  ASSERT_TRUE(Render(view).ok());
  OwnedGradients<float> gradients(scene_);
  SceneGradients d_scene = gradients.View();
  std::vector<float> d_color(3 * kPixels, 1.0f);
  d_color[70] = NAN;
  FrameGradients d_frame;
  d_frame.color = d_color;
  Status status = Backward(view, d_frame, &d_scene);
  EXPECT_NE(status.message().find("d_frame.color[70]"), std::string::npos) << status.message();
  d_frame.color = std::span(d_color).first(5);
  status = Backward(view, d_frame, &d_scene);
  EXPECT_NE(status.message().find("d_frame.color has 5"), std::string::npos) << status.message();
}

// The depth of background pixels is infinite, and what a loss makes of that is often NaN.
TEST_F(ShadedErrorsOfPhong, CotangentsOfDepthAreLookedAtWhereThereIsAFace) {
  const Scene view = scene_.View();
  Outputs request;
  request.depth = true;
  ASSERT_TRUE(Render(view, request).ok());
  std::vector<float> nan(kPixels, NAN), zero(kPixels, 0.0f);
  std::size_t seen = kPixels;
  for (std::size_t i = 0; i < kPixels; ++i) {
    if (frame_.face_ids[i] < 0) continue;
    nan[i] = zero[i] = 0.25f;
    seen = i;
  }
  ASSERT_LT(seen, kPixels);
  OwnedGradients<float> gradients(scene_), expected(scene_);
  SceneGradients d_scene = gradients.View(), d_expected = expected.View();
  FrameGradients d_frame;
  d_frame.depth = zero;
  ASSERT_TRUE(Backward(view, d_frame, &d_expected).ok());
  d_frame.depth = nan;
  Status status = Backward(view, d_frame, &d_scene);
  ASSERT_TRUE(status.ok()) << status.message();
  EXPECT_TRUE(
      std::equal(d_scene.positions.begin(), d_scene.positions.end(), d_expected.positions.begin()));
  nan[seen] = INFINITY;
  status = Backward(view, d_frame, &d_scene);
  EXPECT_EQ(status.message(), "d_frame.depth[" + std::to_string(seen) + "] is inf");
}

// White has no gradient, but its cotangent is an error as any other.
TEST_F(ShadedErrorsOfPhong, CotangentsThatPullNothingAreChecked) {
  Scene view;
  view.positions = scene_.mesh.positions, view.faces = scene_.mesh.faces;
  view.camera = scene_.mesh.camera;
  ASSERT_TRUE(Render(view).ok());
  std::vector<float> d_color(3 * kPixels, 1.0f), d_positions(view.positions.size());
  d_color[70] = NAN;
  FrameGradients d_frame;
  d_frame.color = d_color;
  SceneGradients d_scene;
  d_scene.positions = d_positions;
  const Status status = Backward(view, d_frame, &d_scene);
  EXPECT_EQ(status.message(), "d_frame.color[70] is nan");
}

// Numbers that nobody asked for are looked at, too.
TEST_F(ShadedErrorsOfPhong, AttributesAreCheckedWhateverIsWanted) {
  Scene view = scene_.View();
  std::vector<float> attributes(view.positions.size() / 3, 0.5f);
  attributes[2] = NAN;
  view.attributes = {attributes, Rate::kVertex}, view.channels = 1;
  Outputs request;
  request.attributes = false;
  const Status status = Render(view, request);
  EXPECT_EQ(status.message(), "scene 0: attributes[2] is nan");
}

}  // namespace tilegrad::renderer_contract_test
