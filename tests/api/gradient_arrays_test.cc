// SPDX-License-Identifier: Apache-2.0
// Arrays that gradients go to, which are the caller's: added to, shared by scenes, refused, left as
// they were after an error.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "api/test_scene.h"

namespace tilegrad::gradient_arrays_test {

using test::kAll;
using test::kTestOptions;
using test::TestCotangents;
using test::TestGradients;
using test::TestScene;

TEST(ApiGradientArrays, AddsToWhatIsThere) {
  const TestScene<float> s(Lighting::kPhong);
  Renderer renderer;
  Frame frame;
  ASSERT_TRUE(renderer.Render({&s.scene, 1}, kTestOptions, kAll, &frame).ok());
  const TestCotangents<float> cotangents(frame.images());
  TestGradients<float> plain(s), added(s, 3.0f);
  added.camera.fx = 3;
  added.lights[0].intensity = 3;
  added.surfaces[0].shininess = 3;
  ASSERT_TRUE(renderer.Backward(frame, cotangents.d, {&plain.d, 1}).ok());
  ASSERT_TRUE(renderer.Backward(frame, cotangents.d, {&added.d, 1}, GradientMode::kAdd).ok());
  const auto expect = [](const std::vector<float>& a, const std::vector<float>& b) {
    for (std::size_t i = 0; i < a.size(); ++i) EXPECT_EQ(b[i], a[i] + 3) << i;
  };
  expect(plain.positions, added.positions);
  expect(plain.colors, added.colors);
  expect(plain.uvs, added.uvs);
  expect(plain.texels, added.texels);
  expect(plain.attributes, added.attributes);
  EXPECT_EQ(added.camera.fx, plain.camera.fx + 3);
  EXPECT_EQ(added.lights[0].intensity, plain.lights[0].intensity + 3);
  EXPECT_EQ(plain.surfaces[0].texture, -1);  // is no number that has a gradient
}

// Scenes that share an array get their sum; those that do not, their own. T = double exists for its
// own loop over scenes.
template <class T>
void ExpectSharedArraysGetTheSum() {
  const TestScene<T> s(Lighting::kLambert);
  std::vector<SceneT<T>> scenes(2, s.scene);
  scenes[1].camera.cx += 2;
  RendererT<T> renderer;
  FrameT<T> frame;
  ASSERT_TRUE(renderer.Render(scenes, kTestOptions, {}, &frame).ok());
  const TestCotangents<T> cotangents(frame.images());
  TestGradients<T> first(s), second(s), both(s);
  const std::vector<SceneGradientsT<T>> apart = {first.d, second.d}, shared = {both.d, both.d};
  ASSERT_TRUE(renderer.Backward(frame, cotangents.d, apart).ok());
  ASSERT_TRUE(renderer.Backward(frame, cotangents.d, shared).ok());
  const auto expect = [](const std::vector<T>& a, const std::vector<T>& b,
                         const std::vector<T>& sum) {
    T most = 0;
    for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, std::abs(a[i]));
    EXPECT_GT(most, 0);
    // Sums of about a hundred pixels' shares in another order: their roundings.
    for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(sum[i], a[i] + b[i], 1e-5 * most) << i;
  };
  expect(first.positions, second.positions, both.positions);
  expect(first.texels, second.texels, both.texels);
  expect(first.colors, second.colors, both.colors);
  EXPECT_EQ(both.camera.fx, first.camera.fx + second.camera.fx);
  EXPECT_EQ(both.lights[0].intensity, first.lights[0].intensity + second.lights[0].intensity);
}

TEST(ApiGradientArrays, ScenesThatShareAnArrayGetTheSum) {
  ExpectSharedArraysGetTheSum<float>();
  ExpectSharedArraysGetTheSum<double>();
}

// One array for meshes of two sizes, or for two things: either would be written beyond its end, or
// hold one of them only.
template <class T>
void ExpectArraysThatMeetAreRefused() {
  const TestScene<T> s(Lighting::kNone);
  std::vector<SceneT<T>> scenes(2, s.scene);
  scenes[1].positions = s.scene.positions.first(45);
  scenes[1].faces = s.scene.faces.first(36);
  for (SceneT<T>& scene : scenes) {
    scene.uvs = {};
    scene.textures = {};
    scene.surfaces = {};
    scene.colors.values = scene.colors.values.first(scene.positions.size());
    scene.attributes.values = scene.attributes.values.first(2 * scene.positions.size() / 3);
  }
  RendererT<T> renderer;
  FrameT<T> frame;
  ASSERT_TRUE(renderer.Render(scenes, kTestOptions, {}, &frame).ok());
  const std::vector<T> d_color(frame.images().color.size(), T(1));
  std::vector<T> one(48, T(3)), two(48);
  const auto message = [&](const SceneGradientsT<T>& a, const SceneGradientsT<T>& b,
                           GradientMode mode) {
    const std::vector<SceneGradientsT<T>> d = {a, b};
    return renderer.Backward(frame, {.color = d_color}, d, mode).message();
  };
  const std::span<T> all(one), some = all.first(45);
  const std::string shared = ": only whole arrays of the same kind and size may be shared";
  for (const GradientMode mode : {GradientMode::kOverwrite, GradientMode::kAdd}) {
    EXPECT_EQ(message({.positions = all}, {.positions = some}, mode),
              "d_scene.positions of scene 0 (48 numbers) and d_scene.positions of scene 1 (45 "
              "numbers) overlap" +
                  shared);
    EXPECT_EQ(message({.positions = all, .colors = all}, {}, mode),
              "d_scene.positions of scene 0 (48 numbers) and d_scene.colors of scene 0 (48 "
              "numbers) overlap" +
                  shared);
    EXPECT_EQ(
        message({.positions = two}, {.positions = some, .attributes = all.subspan(7, 30)}, mode),
        "d_scene.positions of scene 1 (45 numbers) and d_scene.attributes of scene 1 (30 "
        "numbers) overlap" +
            shared);
  }
  EXPECT_EQ(one, std::vector<T>(48, T(3)));
  EXPECT_EQ(message({.positions = all}, {.positions = std::span(two).first(45)},
                    GradientMode::kOverwrite),
            "");
}

TEST(ApiGradientArrays, ArraysOfGradientsThatMeetAreRefused) {
  ExpectArraysThatMeetAreRefused<float>();
  ExpectArraysThatMeetAreRefused<double>();
}

// Without mip levels in one scene, with them in the next: there is room for those of both.
TEST(ApiGradientArrays, TexturesOfTwoFiltersShareAGradient) {
  const TestScene<float> s(Lighting::kNone);
  std::vector<std::vector<Texture>> textures(2, s.textures);
  textures[1][0].filter = Filter::kTrilinear;
  std::vector<Scene> scenes(2, s.scene);
  std::vector<float> uvs(s.uvs);
  for (float& x : uvs) x *= 40;  // coarse levels
  for (std::size_t n : {0, 1}) {
    scenes[n].textures = textures[n];
    scenes[n].uvs.values = uvs;
  }
  Renderer renderer;
  Frame frame;
  ASSERT_TRUE(renderer.Render(scenes, kTestOptions, {}, &frame).ok());
  const TestCotangents<float> cotangents(frame.images());
  TestGradients<float> first(s), second(s), both(s);
  const std::vector<SceneGradients> apart = {first.d, second.d}, shared = {both.d, both.d};
  ASSERT_TRUE(renderer.Backward(frame, cotangents.d, apart).ok());
  ASSERT_TRUE(renderer.Backward(frame, cotangents.d, shared).ok());
  for (std::size_t i = 0; i < both.texels.size(); ++i) {
    EXPECT_NEAR(both.texels[i], first.texels[i] + second.texels[i], 1e-3) << i;
  }
}

// Normals that positions have, in a scene that was given others, do not go to those: their arrays
// are of another size.
template <class T>
void ExpectNoGradientOfNormalsThatAreNotUsed() {
  const TestScene<T> s(Lighting::kLambert);
  SceneT<T> scene = s.scene;
  const std::vector<T> normals(9, T(1));
  scene.faces = scene.faces.first(3);
  scene.uvs.values = scene.uvs.values.first(6);
  scene.normals = {normals, Rate::kCorner};
  RendererT<T> renderer;
  FrameT<T> frame;
  ASSERT_TRUE(renderer.Render({&scene, 1}, kTestOptions, kAll, &frame).ok());
  const TestCotangents<T> cotangents(frame.images());
  std::vector<T> d_normals(9, T(5)), d_positions(48);
  const SceneGradientsT<T> d{.positions = d_positions, .normals = d_normals};
  ASSERT_TRUE(renderer.Backward(frame, cotangents.d, {&d, 1}).ok());
  EXPECT_EQ(d_normals, std::vector<T>(9, T(0)));
  EXPECT_NE(d_positions, std::vector<T>(48, T(0)));
}

TEST(ApiGradientArrays, NormalsThatAreNotUsedHaveNoGradient) {
  ExpectNoGradientOfNormalsThatAreNotUsed<float>();
  ExpectNoGradientOfNormalsThatAreNotUsed<double>();
}

TEST(ApiGradientArrays, LeavesArraysAsTheyWereAfterAnErrorWhenAdding) {
  const TestScene<float> s(Lighting::kNone);
  Renderer renderer;
  Frame frame;
  ASSERT_TRUE(renderer.Render({&s.scene, 1}, kTestOptions, {}, &frame).ok());
  std::vector<float> d_color(frame.images().color.size(), 1.0f);
  TestGradients<float> g(s, 2.0f);
  const std::vector<float> before = g.positions;
  d_color[7] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(renderer.Backward(frame, {.color = d_color}, {&g.d, 1}, GradientMode::kAdd).ok());
  EXPECT_EQ(g.positions, before);
  d_color[7] = 1;
  g.colors.assign(g.colors.size(), std::numeric_limits<float>::max());  // + about 1e2: rounds off
  g.texels.assign(g.texels.size(), std::numeric_limits<float>::max());
  d_color.assign(d_color.size(), 1e36f);
  const Status status = renderer.Backward(frame, {.color = d_color}, {&g.d, 1}, GradientMode::kAdd);
  EXPECT_EQ(status.message(), "a sum of gradients overflows");
  EXPECT_EQ(g.positions, before);
}

// Each scene's gradient is finite; the sum in the record that they share, or that the caller's
// numbers are in already, is not.
TEST(ApiGradientArrays, SumsOfRecordsThatOverflowAreErrors) {
  const TestScene<float> s(Lighting::kNone);
  const std::vector<Scene> scenes(2, s.scene);
  Renderer renderer;
  Frame frame;
  ASSERT_TRUE(renderer.Render(scenes, kTestOptions, {}, &frame).ok());
  std::vector<float> d_color(frame.images().color.size(), 1.0f);
  std::vector<Surface> unit(1), apart(1), shared(1);
  const auto message = [&](std::span<Surface> first, std::span<Surface> second, GradientMode mode) {
    const std::vector<SceneGradients> d = {{.surfaces = first}, {.surfaces = second}};
    return renderer.Backward(frame, {.color = d_color}, d, mode).message();
  };
  ASSERT_EQ(message(unit, apart, GradientMode::kOverwrite), "");
  const float steepest = *std::max_element(unit[0].base_color.begin(), unit[0].base_color.end());
  d_color.assign(d_color.size(), 0.6f * std::numeric_limits<float>::max() / steepest);
  ASSERT_EQ(message(unit, apart, GradientMode::kOverwrite), "");
  const std::string overflows = "a sum of gradients overflows";
  EXPECT_EQ(message(shared, shared, GradientMode::kOverwrite), overflows);
  const auto before = unit[0].base_color;
  EXPECT_EQ(message(apart, unit, GradientMode::kAdd), overflows);
  EXPECT_EQ(unit[0].base_color, before);
}

template <class T>
void ExpectDepthOfBackgroundIsNotRead() {
  const TestScene<T> s(Lighting::kNone);
  RendererT<T> renderer;
  FrameT<T> frame;
  ASSERT_TRUE(renderer.Render({&s.scene, 1}, kTestOptions, {.depth = true}, &frame).ok());
  const ImagesT<T>& images = frame.images();
  std::vector<T> d_depth(images.depth.size(), std::numeric_limits<T>::quiet_NaN());
  for (std::size_t i = 0; i < d_depth.size(); ++i) {
    if (images.face_ids[i] >= 0) d_depth[i] = T(1);
  }
  std::vector<T> d_positions(s.positions.size());
  const SceneGradientsT<T> d_scene{.positions = d_positions};
  Status status = renderer.Backward(frame, {.depth = d_depth}, {&d_scene, 1});
  EXPECT_TRUE(status.ok()) << status.message();
  for (const T d : d_positions) EXPECT_TRUE(std::isfinite(d));
  const auto seen = std::find(d_depth.begin(), d_depth.end(), T(1));
  *seen = std::numeric_limits<T>::infinity();
  status = renderer.Backward(frame, {.depth = d_depth}, {&d_scene, 1});
  EXPECT_EQ(status.message(),
            "d_frame.depth[" + std::to_string(seen - d_depth.begin()) + "] is inf");
}
TEST(ApiBackward, CotangentsOfDepthAreNotReadAtTheBackground) {
  ExpectDepthOfBackgroundIsNotRead<float>();
  ExpectDepthOfBackgroundIsNotRead<double>();
}

// What was asked for and is not there: images of a scene without the parts for them are background,
// whatever the frame was used for before and whichever path draws it; gradients of them are 0; a
// batch of no images has the shapes of none. Reads every number, so that the address sanitizer
// finds a view that does not end where its memory ends.

// The scene of one field less, or of only geometry.
template <class T>
struct Sparse {
  std::string name;
  std::function<void(SceneT<T>*)> take;
};

template <class T>
std::vector<Sparse<T>> SparseScenes() {
  const auto no_texture = [](SceneT<T>* s) {
    s->uvs = {};
    s->textures = {};
    s->surfaces = {};
  };
  const auto bare = [=](SceneT<T>* s) {
    no_texture(s);
    s->lights = {};
    s->shading = {};
    s->attributes = {};
    s->channels = 0;
  };
  return {{"no uv", no_texture},
          {"colours", bare},
          {"geometry",
           [=](SceneT<T>* s) {
             bare(s);
             s->colors = {};
           }},
          {"no faces", [](SceneT<T>* s) {
             s->faces = {};
             s->uvs.values = {};
             s->uvs.rate = {};
             s->textures = {};
             s->surfaces = {};
           }}};
}

// Each image alone, each with alpha, each with colour, and all.
std::vector<Outputs> Requests() {
  std::vector<Outputs> out = {kAll};
  bool Outputs::*const images[] = {&Outputs::color,       &Outputs::alpha,   &Outputs::attributes,
                                   &Outputs::depth,       &Outputs::normals, &Outputs::uv,
                                   &Outputs::barycentrics};
  for (const auto image : images) {
    for (const auto other : {&Outputs::alpha, &Outputs::color, image}) {
      Outputs o{false, false, false, false, false, false, false};
      o.*image = o.*other = true;
      out.push_back(o);
    }
  }
  return out;
}

template <class T>
bool Holds(std::span<const T> image, std::size_t size, T value) {
  return image.size() == size &&
         std::all_of(image.begin(), image.end(), [&](T x) { return x == value; });
}

// Sizes of all images, and zeros where the scene has nothing.
template <class T>
void ExpectImages(const ImagesT<T>& i, const SceneT<T>& scene, const Outputs& o) {
  const std::size_t pixels =
      static_cast<std::size_t>(i.count) * static_cast<std::size_t>(i.height * i.width);
  const auto expect = [&](bool wanted, std::size_t planes, std::span<const T> image, bool nothing) {
    EXPECT_EQ(image.size(), wanted ? planes * pixels : 0);
    double sum = 0;
    for (const T x : image) sum += std::isfinite(x) ? std::abs(static_cast<double>(x)) : 0;
    EXPECT_LT(sum, 10.0 * static_cast<double>(image.size() + 1));  // as numbers of the scene are
    EXPECT_TRUE(!nothing || Holds<T>(image, image.size(), T(0)));
  };
  const bool no_face = scene.faces.empty();
  expect(o.color, 3, i.color, no_face);
  expect(o.alpha, 1, i.alpha, no_face);
  expect(o.normals, 3, i.normals, no_face);
  expect(o.barycentrics, 2, i.barycentrics, no_face);
  expect(o.uv, 2, i.uv, scene.uvs.values.empty());
  expect(o.attributes, static_cast<std::size_t>(scene.channels), i.attributes, no_face);
  expect(o.depth, 1, i.depth, false);
  if (no_face && o.depth) {
    EXPECT_TRUE(Holds<T>(i.depth, pixels, std::numeric_limits<T>::infinity()));
  }
}

// A cotangent of every image that the frame has pulls nothing but zeros on what is not there.
template <class T>
void ExpectGradients(RendererT<T>* renderer, const TestScene<T>& s, const SceneT<T>& scene,
                     const FrameT<T>& frame) {
  const std::vector<T> ones(frame.images().uv.size(), T(1));
  TestGradients<T> gradients(s, T(7));
  const Status status = renderer->Backward(
      frame, {.uv = ones}, {{{.positions = gradients.positions, .camera = &gradients.camera}}});
  ASSERT_TRUE(status.ok()) << status.message();
  if (!scene.uvs.values.empty()) return;
  EXPECT_TRUE(Holds<T>(gradients.positions, s.positions.size(), T(0)));
  EXPECT_EQ(gradients.camera.fx, T(0));
}

template <class T>
void RenderAll(FrameT<T>* frame, bool used) {
  RendererT<T> renderer({.threads = 2});
  const TestScene<T> s(Lighting::kPhong);
  RenderOptions small = kTestOptions;
  small.width = small.height = 5;
  for (const Sparse<T>& sparse : SparseScenes<T>()) {
    for (const Outputs& outputs : Requests()) {
      SCOPED_TRACE(sparse.name);
      SceneT<T> scene = s.scene;
      sparse.take(&scene);
      if (used) {
        ASSERT_TRUE(renderer.Render({&s.scene, 1}, small, kAll, frame).ok());
      }
      const Status status = renderer.Render({&scene, 1}, kTestOptions, outputs, frame);
      ASSERT_TRUE(status.ok()) << status.message();
      ExpectImages(frame->images(), scene, outputs);
      ExpectGradients(&renderer, s, scene, *frame);
    }
  }
}

TEST(ApiNothing, IsBackgroundInAFrameUsedBefore) {
  Frame frame;
  RenderAll(&frame, true);
  FrameT<double> truth;
  RenderAll(&truth, true);
}

TEST(ApiNothing, IsBackgroundInAFrameThatIsNew) {
  Frame frame;
  RenderAll(&frame, false);
  FrameT<double> truth;
  RenderAll(&truth, false);
}

TEST(ApiNothing, ABatchOfNoImagesHasNone) {
  RendererT<float> renderer;
  RendererT<double> reference;
  const TestScene<float> s(Lighting::kPhong);
  Frame frame;
  FrameT<double> truth;
  ASSERT_TRUE(renderer.Render({&s.scene, 1}, kTestOptions, kAll, &frame).ok());
  ASSERT_TRUE(renderer.Render({}, kTestOptions, kAll, &frame).ok());
  ASSERT_TRUE(reference.Render({}, kTestOptions, kAll, &truth).ok());
  EXPECT_EQ(frame.images().count, 0);
  EXPECT_TRUE(frame.images().uv.empty() && frame.images().depth.empty());
  EXPECT_TRUE(frame.images().face_ids.empty() && truth.images().face_ids.empty());
  EXPECT_TRUE(renderer.Backward(frame, {}, {}).ok());
  EXPECT_TRUE(reference.Backward(truth, {}, {}).ok());
}

}  // namespace tilegrad::gradient_arrays_test
