// SPDX-License-Identifier: Apache-2.0
// What was asked for and is not there: images of a scene without the parts for them are background,
// whatever the frame was used for before and whichever path draws it; gradients of them are 0; a
// batch of no images has the shapes of none. Reads every number, so that the address sanitizer
// finds a view that does not end where its memory ends.
#include <gtest/gtest.h>
#include <tilegrad/c.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <string>

#include "api/test_scene.h"

namespace tilegrad::nothing_test {

using test::kAll;
using test::kTestOptions;
using test::TestGradients;
using test::TestScene;

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

// In C an image that was asked for is never NULL.
TEST(ApiNothing, IsBackgroundInC) {
  const float positions[] = {-1, -1, -2, 1, -1, -2, 0, 1, -2};
  const std::int32_t faces[] = {0, 1, 2};
  tilegrad_renderer* const renderer = tilegrad_renderer_create(1);
  tilegrad_frame* const frame = tilegrad_frame_create();
  tilegrad_scene scene;
  tilegrad_scene_init(&scene);
  scene.positions = positions;
  scene.vertices = 3;
  scene.faces = faces;
  scene.face_count = 1;
  scene.camera.fx = scene.camera.fy = 20;
  scene.camera.cx = scene.camera.cy = 8;
  tilegrad_options options;
  tilegrad_options_init(&options);
  options.color = options.attributes = 0;
  options.uv = options.depth = 1;
  for (const int size : {3, 40}) {
    options.width = options.height = size;
    ASSERT_EQ(tilegrad_render(renderer, &scene, 1, &options, frame), TILEGRAD_OK);
    tilegrad_images images;
    tilegrad_images_init(&images);
    ASSERT_EQ(tilegrad_frame_images(frame, &images), TILEGRAD_OK);
    ASSERT_NE(images.uv, nullptr);
    ASSERT_NE(images.depth, nullptr);
    const auto numbers = static_cast<std::size_t>(2 * size * size);
    EXPECT_TRUE(Holds<float>({images.uv, numbers}, numbers, 0.0f));
    const std::vector<float> ones(numbers, 1.0f);
    tilegrad_frame_gradients d_frame;
    tilegrad_frame_gradients_init(&d_frame);
    d_frame.uv = ones.data();
    std::vector<float> d_positions(9, 7.0f);
    tilegrad_scene_gradients d_scene;
    tilegrad_scene_gradients_init(&d_scene);
    d_scene.positions = d_positions.data();
    ASSERT_EQ(tilegrad_backward(renderer, frame, &d_frame, &d_scene, 1, 0), TILEGRAD_OK);
    EXPECT_TRUE(Holds<float>(d_positions, 9, 0.0f));
  }
  tilegrad_frame_destroy(frame);
  tilegrad_renderer_destroy(renderer);
}

}  // namespace tilegrad::nothing_test
