// SPDX-License-Identifier: Apache-2.0
// The public renderer beside its promises: images and their shapes, batches, errors, threads.
// Arrays of gradients: gradient_arrays_test.cc; faces cut at the near plane: cut_faces_test.cc.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <thread>
#include <utility>

#include "api/test_scene.h"
#include "support/forked.h"

namespace tilegrad::renderer_api_test {

using test::kAll;
using test::kTestOptions;
using test::TestCotangents;
using test::TestGradients;
using test::TestScene;

template <class T>
std::vector<T> Copy(std::span<const T> values) {
  return {values.begin(), values.end()};
}

template <class T>
std::array<std::span<const T>, 7> AllOf(const ImagesT<T>& i) {
  return {i.color, i.alpha, i.attributes, i.depth, i.normals, i.uv, i.barycentrics};
}

// All images of a frame behind each other.
template <class T>
std::vector<T> Flat(const ImagesT<T>& images) {
  std::vector<T> out;
  for (const auto image : AllOf(images)) out.insert(out.end(), image.begin(), image.end());
  return out;
}

TEST(ApiImages, HaveTheShapesThatTheHeaderSays) {
  const TestScene<float> s(Lighting::kPhong);
  const std::vector<Scene> scenes = {s.scene, s.scene, s.scene};
  Renderer renderer;
  Frame frame;
  ASSERT_TRUE(renderer.Render(scenes, kTestOptions, kAll, &frame).ok());
  const Images& i = frame.images();
  const std::size_t pixels = 3 * 29 * 34;
  EXPECT_EQ(i.count, 3);
  EXPECT_EQ(i.height, 29);
  EXPECT_EQ(i.width, 34);
  EXPECT_EQ(i.channels, 2);
  EXPECT_EQ(i.face_ids.size(), pixels);
  EXPECT_EQ(i.alpha.size(), pixels);
  EXPECT_EQ(i.depth.size(), pixels);
  EXPECT_EQ(i.color.size(), 3 * pixels);
  EXPECT_EQ(i.attributes.size(), 2 * pixels);
  EXPECT_EQ(i.normals.size(), 3 * pixels);
  EXPECT_EQ(i.uv.size(), 2 * pixels);
  EXPECT_EQ(i.barycentrics.size(), 2 * pixels);
  EXPECT_LE(i.alpha_error_bound, kTestOptions.max_alpha_error);
  int faces = 0;
  for (std::size_t p = 0; p < pixels; ++p) {
    faces += i.face_ids[p] >= 0;
    EXPECT_EQ(i.face_ids[p] >= 0, std::isfinite(i.depth[p]));
    EXPECT_EQ(i.face_ids[p] >= 0, i.alpha[p] == 1);
  }
  EXPECT_GT(faces, 300);  // there is something to see
}

TEST(ApiImages, DoNotDependOnWhatElseIsWanted) {
  const TestScene<float> s(Lighting::kPhong);
  Renderer renderer;
  Frame all, one;
  ASSERT_TRUE(renderer.Render({&s.scene, 1}, kTestOptions, kAll, &all).ok());
  bool Outputs::*const images[] = {&Outputs::color,       &Outputs::alpha,   &Outputs::attributes,
                                   &Outputs::depth,       &Outputs::normals, &Outputs::uv,
                                   &Outputs::barycentrics};
  for (std::size_t i = 0; i < std::size(images); ++i) {
    Outputs wanted{false, false, false};
    wanted.*images[i] = true;
    ASSERT_TRUE(renderer.Render({&s.scene, 1}, kTestOptions, wanted, &one).ok());
    EXPECT_EQ(Flat(one.images()), Copy(AllOf(all.images())[i])) << i;
    EXPECT_EQ(Copy(one.images().face_ids), Copy(all.images().face_ids)) << i;
  }
}

// The engine is held to the reference elsewhere; here each image has to be the right one. Colours,
// alpha and attributes are below 2, depth is about 2: 1e-4 is 400 roundings of them.
TEST(ApiImages, FloatAndDoubleAgree) {
  for (const Lighting lighting :
       {Lighting::kNone, Lighting::kLambert, Lighting::kPhong, Lighting::kSphericalHarmonics}) {
    const TestScene<float> s(lighting);
    const TestScene<double> t(lighting);
    Renderer renderer;
    RendererT<double> reference;
    Frame frame;
    FrameT<double> truth;
    ASSERT_TRUE(renderer.Render({&s.scene, 1}, kTestOptions, kAll, &frame).ok());
    const Status status = reference.Render({&t.scene, 1}, kTestOptions, kAll, &truth);
    ASSERT_TRUE(status.ok()) << status.message();
    ASSERT_EQ(Copy(frame.images().face_ids), Copy(truth.images().face_ids));
    const auto a = Flat(frame.images());
    const auto b = Flat(truth.images());
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (!std::isfinite(b[i])) continue;
      EXPECT_NEAR(static_cast<double>(a[i]), b[i], 1e-4) << i;
    }
  }
}

// So are their gradients.
TEST(ApiImages, ScenesOfABatchAreRenderedAsAlone) {
  const TestScene<float> s(Lighting::kLambert);
  std::vector<Scene> scenes(3, s.scene);
  for (std::size_t n = 0; n < 3; ++n) scenes[n].camera.cx += static_cast<float>(n);
  Renderer renderer;
  Frame batch, alone;
  ASSERT_TRUE(renderer.Render(scenes, kTestOptions, {}, &batch).ok());
  TestGradients<float> first(s), second(s), third(s), own(s);
  const TestGradients<float>* const all[] = {&first, &second, &third};
  const SceneGradients d_scenes[] = {first.d, second.d, third.d};
  ASSERT_TRUE(renderer.Backward(batch, {.color = batch.images().color}, d_scenes).ok());
  for (std::size_t n = 0; n < 3; ++n) {
    ASSERT_TRUE(renderer.Render({&scenes[n], 1}, kTestOptions, {}, &alone).ok());
    const auto color = alone.images().color;
    EXPECT_EQ(Copy(batch.images().color.subspan(n * color.size(), color.size())), Copy(color));
    ASSERT_TRUE(renderer.Backward(alone, {.color = color}, {&own.d, 1}).ok());
    EXPECT_EQ(all[n]->positions, own.positions);
    EXPECT_EQ(all[n]->texels, own.texels);
    EXPECT_EQ(all[n]->camera.fx, own.camera.fx);
  }
}

// One step of a batch of three on some number of threads: all images, all gradients. An image of
// side 150 is several bins and bands.
std::vector<float> Step(int threads, int side = 29) {
  const TestScene<float> s(Lighting::kPhong);
  const std::vector<Scene> scenes(3, s.scene);
  RenderOptions options = kTestOptions;
  options.height = side;
  options.width = side + 5;
  Renderer renderer{{.threads = threads}};
  Frame frame;
  EXPECT_TRUE(renderer.Render(scenes, options, kAll, &frame).ok());
  const TestCotangents<float> cotangents(frame.images());
  TestGradients<float> g(s);
  const std::vector<SceneGradients> d_scenes(3, g.d);
  EXPECT_TRUE(renderer.Backward(frame, cotangents.d, d_scenes).ok());
  std::vector<float> out = Flat(frame.images());
  for (const auto* array : {&g.positions, &g.colors, &g.uvs, &g.attributes, &g.texels}) {
    out.insert(out.end(), array->begin(), array->end());
  }
  out.insert(out.end(), g.camera.rotation, g.camera.rotation + 9);
  out.push_back(g.lights[0].intensity);
  out.push_back(g.surfaces[0].shininess);
  return out;
}

TEST(ApiThreads, AnyNumberGivesTheSameBits) {
  for (const int side : {29, 150}) {
    const std::vector<float> one = Step(1, side);
    for (const int threads : {0, 2, 3, 7, 16}) EXPECT_EQ(Step(threads, side), one) << threads;
  }
}

TEST(ApiThreads, RenderersOnTwoThreadsDoNotMeet) {
  const std::vector<float> one = Step(1);
  std::vector<float> a, b;
  std::thread first([&] { a = Step(2); }), second([&] { b = Step(2); });
  first.join();
  second.join();
  EXPECT_EQ(a, one);
  EXPECT_EQ(b, one);
}

// A renderer that has rendered before the fork, whose frame is used after it, and a new one.
TEST(ApiThreads, AForkedChildGetsTheSameBits) {
  if (const char* why = test::WhyNoFork()) GTEST_SKIP() << why;
  const TestScene<float> s(Lighting::kPhong);
  const std::vector<Scene> scenes(3, s.scene);
  Renderer renderer{{.threads = 3}};
  Frame frame;
  ASSERT_TRUE(renderer.Render(scenes, kTestOptions, kAll, &frame).ok());
  const TestCotangents<float> cotangents(frame.images());
  const auto backward = [&](TestGradients<float>* g) {
    const std::vector<SceneGradients> d_scenes(3, g->d);
    return renderer.Backward(frame, cotangents.d, d_scenes).ok();
  };
  TestGradients<float> here(s), there(s);
  ASSERT_TRUE(backward(&here));
  const std::vector<float> images = Flat(frame.images()), one = Step(1);
  EXPECT_TRUE(test::TrueInChild([&] {
    if (!backward(&there) || there.positions != here.positions) return false;
    return renderer.Render(scenes, kTestOptions, kAll, &frame).ok() &&
           Flat(frame.images()) == images && Step(2) == one;
  }));
  EXPECT_EQ(Step(2), one);
}

TEST(ApiFrame, MovesAndOutlivesItsRenderer) {
  const TestScene<float> s(Lighting::kNone);
  Frame frame;
  {
    Renderer renderer;
    ASSERT_TRUE(renderer.Render({&s.scene, 1}, kTestOptions, {}, &frame).ok());
  }
  Frame moved = std::move(frame);
  EXPECT_EQ(frame.images().width, 0);  // NOLINT: what a moved frame holds is promised
  EXPECT_EQ(moved.images().width, 34);
  const TestCotangents<float> cotangents(moved.images());
  TestGradients<float> g(s);
  Renderer other;
  EXPECT_TRUE(other.Backward(moved, cotangents.d, {&g.d, 1}).ok());
  const Status nothing = other.Backward(frame, {}, {});
  EXPECT_EQ(nothing.code(), StatusCode::kInvalidArgument);
}

struct BadCall {
  const char* expected;  // part of the message
  std::function<void(Scene&, RenderOptions&)> spoil;
};

const std::vector<float> kSeven(7), kTwo(2), kInfinite(48, INFINITY);
const std::vector<std::int32_t> kBeyond = {0, 1, 16}, kNegative = {0, 1, -1}, kOnes(18, 1);
const std::vector<Light> kNoDirection = {{}, {.direction = {0, 0, 0}}};
const std::vector<Light> kNoNumber = {{}, {.direction = {0, 0, 1}, .intensity = NAN}};
const std::vector<Texture> kShort = {{kSeven, 5, 4}}, kNoTexels = {{{}, 0, 8}};
const std::vector<Texture> kNoSuchWrap = {{std::span(kSeven).first(3), 1, 1},
                                          {.wrap = static_cast<Wrap>(9)}};
const std::vector<Surface> kNoSuchTexture = {{.texture = 3}};
const std::vector<Surface> kTooDull = {{.texture = 0, .shininess = -1}};

std::vector<float> NanAt5() {
  std::vector<float> out(48);
  out[5] = NAN;
  return out;
}

const std::vector<float> kNanAt5 = NanAt5();

// Of the second of two scenes, unlit, of 16 vertices and 18 faces. What shading does not use is
// looked at, too.
const BadCall kBadCalls[] = {
    {"scene 1: positions must be [V,3], got 7 numbers",
     [](auto& s, auto&) { s.positions = kSeven; }},
    {"scene 1: positions[5] is nan", [](auto& s, auto&) { s.positions = kNanAt5; }},
    {"scene 1: faces must be [F,3], got 2 indices",
     [](auto& s, auto&) { s.faces = s.faces.first(2); }},
    {"scene 1: faces[2] is 16, outside of [0, 16)", [](auto& s, auto&) { s.faces = kBeyond; }},
    {"scene 1: faces[2] is -1, outside of [0, 16)", [](auto& s, auto&) { s.faces = kNegative; }},
    {"scene 1: colors must be [16,3], got 2 numbers",
     [](auto& s, auto&) { s.colors.values = kTwo; }},
    {"scene 1: colors[5] is nan", [](auto& s, auto&) { s.colors.values = kNanAt5; }},
    {"scene 1: colors.rate is 9, must be in 0..1",
     [](auto& s, auto&) { s.colors.rate = static_cast<Rate>(9); }},
    {"scene 1: uvs must be [54,2], got 7 numbers", [](auto& s, auto&) { s.uvs.values = kSeven; }},
    {"scene 1: the scene has textures, but no uvs", [](auto& s, auto&) { s.uvs.values = {}; }},
    {"scene 1: attributes differ from those of scene 0: a batch must agree",
     [](auto& s, auto&) {
       s.channels = 1;
       s.attributes.values = s.attributes.values.first(16);
     }},
    {"scene 1: attributes must be [16,3], got 32 numbers", [](auto& s, auto&) { s.channels = 3; }},
    {"scene 1: attributes[5] is nan",
     [](auto& s, auto&) { s.attributes.values = std::span(kNanAt5).first(32); }},
    {"scene 1: normals must be [16,3], got 7 numbers",
     [](auto& s, auto&) { s.normals.values = kSeven; }},
    {"scene 1: normals[0] is inf", [](auto& s, auto&) { s.normals.values = kInfinite; }},
    {"shading.normals is kGiven, but the scene has no normals",
     [](auto& s, auto&) { s.shading.normals = Normals::kGiven; }},
    {"scene 1: light_directions must be [16,3], got 7 numbers",
     [](auto& s, auto&) { s.light_directions = kSeven; }},
    {"scene 1: light_directions[0] is inf", [](auto& s, auto&) { s.light_directions = kInfinite; }},
    {"scene 1: sh has 7 numbers, expected 9", [](auto& s, auto&) { s.sh = kSeven; }},
    {"scene 1: sh[0] is inf", [](auto& s, auto&) { s.sh = std::span(kInfinite).first(9); }},
    {"scene 1: sh has 0",
     [](auto& s, auto&) { s.shading.lighting = Lighting::kSphericalHarmonics; }},
    {"scene 1: lights[1]: intensity[0] is nan", [](auto& s, auto&) { s.lights = kNoNumber; }},
    {"scene 1: lights[1]: direction is 0 0 0, must not be 0",
     [](auto& s, auto&) {
       s.shading.lighting = Lighting::kPhong;
       s.lights = kNoDirection;
     }},
    {"scene 1: lighting needs either lights or light_directions; the scene has neither",
     [](auto& s, auto&) { s.shading.lighting = Lighting::kPhong; }},
    {"scene 1: textures[0]: texels", [](auto& s, auto&) { s.textures = kShort; }},
    {"scene 1: textures[1]: wrap is 9", [](auto& s, auto&) { s.textures = kNoSuchWrap; }},
    {"scene 1: textures[0]: width is 0", [](auto& s, auto&) { s.textures = kNoTexels; }},
    {"scene 1: surfaces[0]: texture is 3, outside of [-1, 1)",
     [](auto& s, auto&) { s.surfaces = kNoSuchTexture; }},
    {"scene 1: surfaces[0]: shininess is -1", [](auto& s, auto&) { s.surfaces = kTooDull; }},
    {"scene 1: face_surfaces[0] is 1", [](auto& s, auto&) { s.face_surfaces = kOnes; }},
    {"scene 1: options of the shading model differ",
     [](auto& s, auto&) { s.shading.clamp = true; }},
    {"scene 1: camera.near_plane is 0", [](auto& s, auto&) { s.camera.near_plane = 0; }},
    {"scene 1: camera.rotation[3] is nan", [](auto& s, auto&) { s.camera.rotation[3] = NAN; }},
    {"scene 1: camera.fx is 0, must be in -1e+30..1e+30 and not 0",
     [](auto& s, auto&) { s.camera.fx = 0; }},
    {"scene 1: camera.fy is inf", [](auto& s, auto&) { s.camera.fy = INFINITY; }},
    {"scene 1: camera.fx is -3e+38", [](auto& s, auto&) { s.camera.fx = -3e38f; }},
    {"scene 1: camera.cx is nan, must be finite", [](auto& s, auto&) { s.camera.cx = NAN; }},
    {"options.width is 0", [](auto&, auto& o) { o.width = 0; }},
    {"options.delta is -1", [](auto&, auto& o) { o.delta = -1; }},
    {"options.max_alpha_error is 2", [](auto&, auto& o) { o.max_alpha_error = 2; }},
    {"scene 1: camera.cy is nan", [](auto& s, auto&) { s.camera.cy = NAN; }},
    {"scene 1: camera.near_plane is nan", [](auto& s, auto&) { s.camera.near_plane = NAN; }},
    {"options.delta is nan", [](auto&, auto& o) { o.delta = NAN; }},
    {"options.max_alpha_error is nan", [](auto&, auto& o) { o.max_alpha_error = NAN; }},
    {"options.paper_box is -1, must be finite and >= 0",
     [](auto&, auto& o) {
       o.alpha_rule = AlphaRule::kPaper;
       o.paper_box = -1;
     }},
    {"options.culling is 2", [](auto&, auto& o) { o.culling = static_cast<FaceCulling>(2); }},
};

TEST(ApiErrors, SayWhatIsWrongAndWhere) {
  const TestScene<float> s(Lighting::kNone);
  Renderer renderer;
  Frame frame;
  for (const BadCall& call : kBadCalls) {
    std::vector<Scene> scenes = {s.scene, s.scene};
    RenderOptions options = kTestOptions;
    call.spoil(scenes[1], options);
    const Status status = renderer.Render(scenes, options, {.attributes = false}, &frame);
    EXPECT_EQ(status.code(), StatusCode::kInvalidArgument) << call.expected;
    EXPECT_NE(status.message().find(call.expected), std::string::npos)
        << "got: " << status.message() << "\nexpected: " << call.expected;
    EXPECT_EQ(frame.images().width, 0);
  }
}

// At the first and last place of an array and in the middle: parts of it are looked through by
// themselves.
TEST(ApiErrors, NumbersThatAreNoneAreNamedWhereverTheyStand) {
  TestScene<float> s(Lighting::kNone);
  Camera& camera = s.scene.camera;
  std::vector<float> d_alpha(34 * 29), d_attributes(2 * 34 * 29), d_positions(48);
  const SceneGradients d{.positions = d_positions};
  Renderer renderer;
  Frame frame;
  const auto message = [&] {
    const Status status = renderer.Render({&s.scene, 1}, kTestOptions, {}, &frame);
    if (!status.ok()) return status.message();
    return renderer.Backward(frame, {.alpha = d_alpha, .attributes = d_attributes}, {&d, 1})
        .message();
  };
  const std::pair<std::string, std::span<float>> arrays[] = {
      {"scene 0: positions", s.positions},
      {"scene 0: attributes", s.attributes},
      {"scene 0: camera.rotation", camera.rotation},
      {"scene 0: camera.translation", camera.translation},
      {"d_frame.attributes", d_attributes},
      {"d_frame.alpha", d_alpha}};
  for (const auto& [name, values] : arrays) {
    for (const std::size_t i : {std::size_t{0}, values.size() / 2, values.size() - 1}) {
      for (const float bad : {NAN, INFINITY, -INFINITY}) {
        const float kept = std::exchange(values[i], bad);
        EXPECT_NE(message().find(name + "[" + std::to_string(i) + "] is "), std::string::npos)
            << name << ' ' << i;
        values[i] = kept;
      }
    }
  }
  EXPECT_EQ(message(), "");
}

// Vertices that no face has are packed with the others.
TEST(ApiErrors, VerticesWithoutFacesHaveNormalsToo) {
  const TestScene<float> s(Lighting::kLambert);
  Scene scene;
  scene.positions = s.positions;
  scene.lights = s.lights;
  scene.shading.lighting = Lighting::kLambert;
  scene.shading.normals = Normals::kGiven;
  Renderer renderer;
  Frame frame;
  EXPECT_NE(renderer.Render({&scene, 1}, kTestOptions, kAll, &frame).message().find("no normals"),
            std::string::npos);
  scene.normals = {s.positions, Rate::kVertex};
  EXPECT_TRUE(renderer.Render({&scene, 1}, kTestOptions, kAll, &frame).ok());
  scene.normals = {{}, Rate::kCorner};
  EXPECT_TRUE(renderer.Render({&scene, 1}, kTestOptions, kAll, &frame).ok());
}

// On an edge the distance is 0, and infinity times 0 is no number.
TEST(ApiImages, TheSharpestKernelIsAHardMask) {
  const TestScene<float> s(Lighting::kNone);
  Renderer renderer;
  Frame frame;
  RenderOptions options = kTestOptions;
  for (const AlphaRule rule : {AlphaRule::kAllFaces, AlphaRule::kPaper}) {
    options.delta = 1e-320;
    options.alpha_rule = rule;
    options.culling = FaceCulling::kBack;
    // A face that is drawn to a line through pixel centres.
    std::vector<float> positions = s.positions;
    for (std::size_t v = 0; v < 16; ++v) positions[3 * v + 1] = 0.5f / 30 * positions[3 * v + 2];
    Scene scene = s.scene;
    scene.positions = positions;
    ASSERT_TRUE(renderer.Render({&scene, 1}, options, {}, &frame).ok());
    const std::vector<float> d_alpha(frame.images().alpha.size(), 1.0f);
    for (const float alpha : frame.images().alpha) ASSERT_TRUE(alpha == 0 || alpha == 1) << alpha;
    std::vector<float> d_positions(48);
    const SceneGradients d{.positions = d_positions};
    const Status status = renderer.Backward(frame, {.alpha = d_alpha}, {&d, 1});
    EXPECT_TRUE(status.ok()) << status.message();
  }
}

// Channels that no array has, because there is no vertex, are not added up beyond what int holds.
TEST(ApiErrors, ChannelsHaveALimit) {
  TestScene<float> s(Lighting::kNone);
  Scene scene;
  scene.shading.lighting = Lighting::kSphericalHarmonics;
  const std::vector<float> sh(9, 0.5f);
  scene.sh = sh;
  scene.channels = std::numeric_limits<int>::max();
  Renderer renderer;
  Frame frame;
  const Status status = renderer.Render({&scene, 1}, kTestOptions, {}, &frame);
  EXPECT_EQ(status.code(), StatusCode::kResourceExhausted);
  EXPECT_NE(status.message().find("2147483647 channels"), std::string::npos) << status.message();
}

TEST(ApiErrors, DoubleRefusesWhatFloatCannotHold) {
  TestScene<double> s(Lighting::kNone);
  s.positions[4] = 1e300;
  RendererT<double> renderer;
  FrameT<double> frame;
  EXPECT_EQ(renderer.Render({&s.scene, 1}, kTestOptions, {}, &frame).message(),
            "scene 0: positions[4] is inf");
}

TEST(ApiErrors, OfTheWayBackAndOfRenderers) {
  const TestScene<float> s(Lighting::kNone);
  Renderer renderer;
  Frame frame;
  ASSERT_TRUE(renderer.Render({&s.scene, 1}, kTestOptions, {.alpha = false}, &frame).ok());
  std::vector<float> wrong(5), d_alpha(34 * 29), d_positions(5);
  const SceneGradients none, bad{.positions = d_positions};
  const auto message = [&](const FrameGradients& d_frame, std::span<const SceneGradients> d) {
    return renderer.Backward(frame, d_frame, d).message();
  };
  EXPECT_EQ(message({.color = wrong}, {&none, 1}), "d_frame.color has 5 numbers, expected 2958");
  EXPECT_EQ(message({}, {&bad, 1}), "scene 0: d_scene.positions has 5 numbers, expected 48");
  EXPECT_EQ(message({}, {}), "d_scenes has 0 entries, expected 1: one per scene");
  EXPECT_EQ(message({.alpha = d_alpha}, {&none, 1}),
            "d_frame.alpha is given, but alpha was not rendered");
  std::vector<float> d_color(3 * 34 * 29);
  d_color[70] = NAN;
  d_positions.resize(48);
  const SceneGradients good{.positions = d_positions};
  EXPECT_EQ(message({.color = d_color}, {&good, 1}), "d_frame.color[70] is nan");
  Renderer many{{.threads = 5000}};
  EXPECT_EQ(many.Render({}, {}, {}, &frame).message(), "threads is 5000, must be in 0..1024");
  EXPECT_FALSE(renderer.Render({}, {}, {}, nullptr).ok());
}

}  // namespace tilegrad::renderer_api_test
