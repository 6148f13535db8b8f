// SPDX-License-Identifier: Apache-2.0
// The C interface: the same bits as the C++ one, struct sizes of other versions, and errors.
#include <gtest/gtest.h>
#include <malloc.h>
#include <tilegrad/c.h>

#include <algorithm>
#include <cfenv>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <limits>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

#include "api/c_caller.h"
#include "api/test_scene.h"

namespace tilegrad::c_test {

using test::kAll;
using test::kTestOptions;
using test::TestCotangents;
using test::TestGradients;
using test::TestScene;

// The scene of a TestScene in C.
struct CScene {
  tilegrad_texture texture;
  tilegrad_surface surface;
  tilegrad_light light;
  tilegrad_scene scene;

  explicit CScene(const TestScene<float>& s) {
    tilegrad_scene_init(&scene);
    scene.positions = s.positions.data();
    scene.vertices = 16;
    scene.faces = s.faces.data();
    scene.face_count = s.faces.size() / 3;
    const Camera& c = s.scene.camera;
    scene.camera.fx = c.fx;
    scene.camera.fy = c.fy;
    scene.camera.cx = c.cx;
    scene.camera.cy = c.cy;
    scene.colors = {s.colors.data(), 0};
    scene.uvs = {s.uvs.data(), 1};
    scene.attributes = {s.attributes.data(), 0};
    scene.channels = 2;
    texture = {s.texels.data(), 5, 4, 1, 1};
    const Surface& f = s.surfaces[0];
    surface = {{f.base_color[0], f.base_color[1], f.base_color[2]},
               {f.ambient[0], f.ambient[1], f.ambient[2]},
               {f.diffuse[0], f.diffuse[1], f.diffuse[2]},
               {f.specular[0], f.specular[1], f.specular[2]},
               f.shininess,
               f.texture};
    const Light& l = s.lights[0];
    light = {{l.direction[0], l.direction[1], l.direction[2]}, l.intensity};
    scene.textures = &texture;
    scene.texture_count = 1;
    scene.surfaces = &surface;
    scene.surface_count = 1;
    scene.lights = &light;
    scene.light_count = 1;
    scene.lighting = 2;
  }
};

class CApi : public testing::Test {
 protected:
  CApi() : s(Lighting::kPhong), c(s) {
    tilegrad_options_init(&options);
    options.width = 34;
    options.height = 29;
    options.delta = 1e-3;
    options.depth = options.normals = options.uv = options.barycentrics = 1;
  }
  ~CApi() override {
    tilegrad_frame_destroy(frame);
    tilegrad_renderer_destroy(renderer);
  }

  std::string ErrorOf(tilegrad_status status) {
    EXPECT_EQ(status, TILEGRAD_INVALID_ARGUMENT);
    return tilegrad_last_error(renderer);
  }
  tilegrad_status Render() { return tilegrad_render(renderer, &c.scene, 1, &options, frame); }
  // Of a request for one gradient that cannot be had.
  template <class T>
  std::string ErrorOfRequest(T tilegrad_scene_gradients::*what, std::type_identity_t<T> where) {
    tilegrad_frame_gradients d_frame;
    tilegrad_frame_gradients_init(&d_frame);
    tilegrad_scene_gradients d_scene;
    tilegrad_scene_gradients_init(&d_scene);
    d_scene.*what = where;
    return ErrorOf(tilegrad_backward(renderer, frame, &d_frame, &d_scene, 1, 0));
  }
  // The gradients of the rendered frame, for cotangents `d`, are `g`, bit by bit.
  void ExpectGradients(const FrameGradients& d, const TestGradients<float>& g) {
    tilegrad_frame_gradients d_frame;
    tilegrad_frame_gradients_init(&d_frame);
    d_frame.color = d.color.data();
    d_frame.alpha = d.alpha.data();
    d_frame.depth = d.depth.data();
    TestGradients<float> h(s);
    float* textures[1] = {h.texels.data()};
    tilegrad_camera d_camera = {};
    tilegrad_surface d_surface = {};
    tilegrad_light d_light = {};
    tilegrad_scene_gradients d_scene;
    tilegrad_scene_gradients_init(&d_scene);
    d_scene.positions = h.positions.data();
    d_scene.colors = h.colors.data();
    d_scene.uvs = h.uvs.data();
    d_scene.textures = textures;
    d_scene.camera = &d_camera;
    d_scene.surfaces = &d_surface;
    d_scene.lights = &d_light;
    ASSERT_EQ(tilegrad_backward(renderer, frame, &d_frame, &d_scene, 1, 0), TILEGRAD_OK)
        << tilegrad_last_error(renderer);
    EXPECT_EQ(g.positions, h.positions);
    EXPECT_EQ(g.colors, h.colors);
    EXPECT_EQ(g.uvs, h.uvs);
    EXPECT_EQ(g.texels, h.texels);
    EXPECT_EQ(d_camera.rotation[5], g.camera.rotation[5]);
    EXPECT_EQ(d_camera.fx, g.camera.fx);
    EXPECT_EQ(d_surface.shininess, g.surfaces[0].shininess);
    EXPECT_EQ(d_light.direction[1], g.lights[0].direction[1]);
    ASSERT_EQ(tilegrad_backward(renderer, frame, &d_frame, &d_scene, 1, 1), TILEGRAD_OK);
    EXPECT_EQ(d_camera.fx, 2 * g.camera.fx);
    EXPECT_EQ(h.colors[9], 2 * g.colors[9]);
  }

  TestScene<float> s;
  CScene c;
  tilegrad_options options;
  tilegrad_renderer* renderer = tilegrad_renderer_create(1);
  tilegrad_frame* frame = tilegrad_frame_create();
};

TEST_F(CApi, GivesTheBitsOfTheCppInterface) {
  ASSERT_EQ(Render(), TILEGRAD_OK) << tilegrad_last_error(renderer);
  EXPECT_STREQ(tilegrad_last_error(renderer), "");
  tilegrad_images images;
  tilegrad_images_init(&images);
  ASSERT_EQ(tilegrad_frame_images(frame, &images), TILEGRAD_OK);
  Renderer cpp;
  Frame expected;
  ASSERT_TRUE(cpp.Render({&s.scene, 1}, kTestOptions, kAll, &expected).ok());
  const Images& e = expected.images();
  EXPECT_TRUE(std::equal(e.color.begin(), e.color.end(), images.color));
  EXPECT_TRUE(std::equal(e.alpha.begin(), e.alpha.end(), images.alpha));
  EXPECT_TRUE(std::equal(e.uv.begin(), e.uv.end(), images.uv));
  EXPECT_TRUE(std::equal(e.depth.begin(), e.depth.end(), images.depth));
  EXPECT_TRUE(std::equal(e.face_ids.begin(), e.face_ids.end(), images.face_ids));
  const TestCotangents<float> d(e);
  const FrameGradients d_cpp = {.color = d.color, .alpha = d.alpha, .depth = d.depth};
  TestGradients<float> g(s);
  ASSERT_TRUE(cpp.Backward(expected, d_cpp, {&g.d, 1}).ok());
  ExpectGradients(d_cpp, g);
}

// Threads of the renderer may round otherwise than the caller's: then the bits would say which of
// them computed what.
TEST_F(CApi, TheCallersRoundingIsNotTheRenderers) {
  const auto step = [&] {
    tilegrad_images images;
    tilegrad_images_init(&images);
    tilegrad_frame_gradients d_frame;
    tilegrad_frame_gradients_init(&d_frame);
    tilegrad_scene_gradients d_scene;
    tilegrad_scene_gradients_init(&d_scene);
    std::vector<float> out(48);
    d_scene.positions = out.data();
    EXPECT_EQ(Render(), TILEGRAD_OK);
    EXPECT_EQ(tilegrad_frame_images(frame, &images), TILEGRAD_OK);
    d_frame.color = images.color;
    EXPECT_EQ(tilegrad_backward(renderer, frame, &d_frame, &d_scene, 1, 0), TILEGRAD_OK);
    out.insert(out.end(), images.color, images.color + 3 * 34 * 29);
    return out;
  };
  const std::vector<float> expected = step();
  std::fesetround(FE_UPWARD);
  const std::vector<float> upward = step();
  EXPECT_EQ(std::fegetround(), FE_UPWARD);
  std::fesetround(FE_TONEAREST);
  EXPECT_EQ(upward, expected);
}

// A caller of an older version has shorter structs: what it does not know has its default. Here
// options end behind `delta`, and scenes behind `camera`.
TEST_F(CApi, ShorterStructsHaveDefaultsForTheRest) {
  options.struct_size = offsetof(tilegrad_options, max_alpha_error);
  options.interpolation = 77;  // is not read
  c.scene.struct_size = offsetof(tilegrad_scene, colors);
  ASSERT_EQ(Render(), TILEGRAD_OK) << tilegrad_last_error(renderer);
  tilegrad_images images;
  tilegrad_images_init(&images);
  images.struct_size = offsetof(tilegrad_images, uv);
  images.uv = reinterpret_cast<const float*>(this);
  ASSERT_EQ(tilegrad_frame_images(frame, &images), TILEGRAD_OK);
  EXPECT_NE(images.alpha, nullptr);
  EXPECT_EQ(images.uv, reinterpret_cast<const float*>(this));  // is not written
  tilegrad_options small;
  std::memset(&small, 0x55, sizeof small);
  tilegrad_options_init_sized(&small, offsetof(tilegrad_options, delta));
  EXPECT_EQ(small.width, 64);
  EXPECT_NE(small.delta, 1.0 / 7000);
  tilegrad_options_init(static_cast<tilegrad_options*>(nullptr));  // nothing to fill
}

TEST_F(CApi, LargerStructsMustNotSayWhatIsNotKnown) {
  struct {
    tilegrad_options known;
    int future;
  } newer = {options, 0};
  newer.known.struct_size = sizeof newer;
  EXPECT_EQ(tilegrad_render(renderer, &c.scene, 1, &newer.known, frame), TILEGRAD_OK);
  newer.future = 1;
  EXPECT_EQ(ErrorOf(tilegrad_render(renderer, &c.scene, 1, &newer.known, frame)),
            "options has members that this library (" TILEGRAD_VERSION ") does not know");
}

TEST_F(CApi, AFrameHoldsNothingAfterAnyError) {
  ASSERT_EQ(Render(), TILEGRAD_OK);
  EXPECT_EQ(ErrorOf(tilegrad_render(renderer, &c.scene, 1, nullptr, frame)), "options is NULL");
  tilegrad_images images;
  tilegrad_images_init(&images);
  ASSERT_EQ(tilegrad_frame_images(frame, &images), TILEGRAD_OK);
  EXPECT_EQ(images.face_ids, nullptr);
  EXPECT_EQ(images.count, 0);
}

// A pointer that was forgotten is no empty array; a size of -1 is none.
TEST_F(CApi, WrongScenesAreNamed) {
  constexpr std::size_t kMinusOne = SIZE_MAX;
  const std::pair<void (*)(CScene&), const char*> cases[] = {
      {[](CScene& of) { of.scene.faces = nullptr; }, "faces is NULL, but face_count is 18"},
      {[](CScene& of) { of.scene.positions = nullptr; }, "positions is NULL, but vertices is 16"},
      {[](CScene& of) { of.scene.textures = nullptr; }, "textures is NULL, but texture_count is 1"},
      {[](CScene& of) { of.scene.surfaces = nullptr; }, "surfaces is NULL, but surface_count is 1"},
      {[](CScene& of) { of.scene.light_count = kMinusOne; },
       "light_count is 18446744073709551615, must be in 0..2147483647"},
      {[](CScene& of) { of.scene.vertices = kMinusOne / 2; },
       "vertices is 9223372036854775807, must be in 0..2147483647"},
      {[](CScene& of) { of.scene.lighting = 4; }, "shading.lighting is 4, must be in 0..3"},
      {[](CScene& of) { of.texture.width = -5; },
       "textures[0]: width is -5, must be in 1..16384 texels"},
      {[](CScene& of) { of.scene.channels = 0; }, "attributes is given, but channels is 0"},
      {[](CScene& of) { of.scene.struct_size = 0; },
       "scene.struct_size is 0: call tilegrad_..._init first"}};
  for (const auto& [spoil, message] : cases) {
    const tilegrad_scene scene = c.scene;
    const tilegrad_texture texture = c.texture;
    spoil(c);
    EXPECT_EQ(ErrorOf(Render()), std::string("scene 0: ") + message);
    c.scene = scene;
    c.texture = texture;
  }
}

// Their arrays would stay as they were, whatever that was.
TEST_F(CApi, GradientsOfWhatIsNotThereAreRefused) {
  ASSERT_EQ(Render(), TILEGRAD_OK);
  float numbers[48] = {};
  EXPECT_EQ(ErrorOfRequest(&tilegrad_scene_gradients::sh, numbers),
            "scene 0: d_scene.sh is requested, but the scene has none");
  EXPECT_EQ(ErrorOfRequest(&tilegrad_scene_gradients::normals, numbers),
            "scene 0: d_scene.normals is requested, but the scene has none");
  c.scene.textures = nullptr;
  c.scene.texture_count = 0;
  c.surface.texture = -1;
  c.scene.lights = nullptr;
  c.scene.light_count = 0;
  c.scene.lighting = 0;
  ASSERT_EQ(Render(), TILEGRAD_OK) << tilegrad_last_error(renderer);
  float* textures[1] = {};
  tilegrad_light d_light = {};
  EXPECT_EQ(ErrorOfRequest(&tilegrad_scene_gradients::textures, textures),
            "scene 0: d_scene.textures is requested, but the scene has none");
  EXPECT_EQ(ErrorOfRequest(&tilegrad_scene_gradients::lights, &d_light),
            "scene 0: d_scene.lights is requested, but the scene has none");
}

TEST_F(CApi, SumsOfRecordsThatOverflowAreErrors) {
  ASSERT_EQ(Render(), TILEGRAD_OK);
  std::vector<float> d_color(3 * 34 * 29, 1.0f);
  tilegrad_frame_gradients d_frame;
  tilegrad_frame_gradients_init(&d_frame);
  d_frame.color = d_color.data();
  tilegrad_surface d_surface = {};
  tilegrad_scene_gradients d_scene;
  tilegrad_scene_gradients_init(&d_scene);
  d_scene.surfaces = &d_surface;
  d_surface.base_color[1] = std::numeric_limits<float>::max();
  d_color.assign(d_color.size(), 1e33f);
  EXPECT_EQ(ErrorOf(tilegrad_backward(renderer, frame, &d_frame, &d_scene, 1, 1)),
            "a sum of gradients overflows");
}

TEST_F(CApi, StructsOfAnArrayHaveOneSize) {
  tilegrad_scene scenes[2] = {c.scene, c.scene};
  scenes[1].struct_size = offsetof(tilegrad_scene, sh);
  EXPECT_EQ(ErrorOf(tilegrad_render(renderer, scenes, 2, &options, frame)),
            "scene 1: scene.struct_size is " + std::to_string(offsetof(tilegrad_scene, sh)) +
                ", that of the first is " + std::to_string(sizeof(tilegrad_scene)));
}

TEST_F(CApi, ImagesWithoutInitAreNotWritten) {
  tilegrad_images images;
  std::memset(&images, 0x55, sizeof images);
  EXPECT_EQ(tilegrad_frame_images(frame, &images), TILEGRAD_INVALID_ARGUMENT);
  images.struct_size = 0;
  EXPECT_EQ(tilegrad_frame_images(frame, &images), TILEGRAD_INVALID_ARGUMENT);
}

// An image that was asked for is never NULL; of a scene without the parts for it it is zeros, which
// pull at nothing.
TEST_F(CApi, ImagesOfWhatIsNotThereAreZeros) {
  c.scene.uvs = {};
  c.scene.textures = nullptr;
  c.scene.texture_count = 0;
  c.surface.texture = -1;
  for (const int size : {3, 40}) {
    options.width = options.height = size;
    ASSERT_EQ(Render(), TILEGRAD_OK) << tilegrad_last_error(renderer);
    tilegrad_images images;
    tilegrad_images_init(&images);
    ASSERT_EQ(tilegrad_frame_images(frame, &images), TILEGRAD_OK);
    ASSERT_NE(images.uv, nullptr);
    ASSERT_NE(images.depth, nullptr);
    const std::vector<float> ones(static_cast<std::size_t>(2 * size * size), 1.0f);
    EXPECT_EQ(std::count(images.uv, images.uv + ones.size(), 0.0f), std::ssize(ones));
    tilegrad_frame_gradients d_frame;
    tilegrad_frame_gradients_init(&d_frame);
    d_frame.uv = ones.data();
    std::vector<float> d_positions(48, 7.0f);
    tilegrad_scene_gradients d_scene;
    tilegrad_scene_gradients_init(&d_scene);
    d_scene.positions = d_positions.data();
    ASSERT_EQ(tilegrad_backward(renderer, frame, &d_frame, &d_scene, 1, 0), TILEGRAD_OK);
    EXPECT_EQ(d_positions, std::vector<float>(48, 0.0f));
  }
}

TEST_F(CApi, SaysWhatIsWrong) {
  EXPECT_EQ(ErrorOf(tilegrad_render(renderer, &c.scene, 1, nullptr, frame)), "options is NULL");
  EXPECT_EQ(ErrorOf(tilegrad_render(renderer, nullptr, 1, &options, frame)),
            "scene 0: scene is NULL");
  EXPECT_EQ(ErrorOf(tilegrad_render(renderer, &c.scene, 1, &options, nullptr)), "frame is NULL");
  EXPECT_EQ(tilegrad_render(nullptr, &c.scene, 1, &options, frame), TILEGRAD_INVALID_ARGUMENT);
  EXPECT_EQ(ErrorOf(tilegrad_render(renderer, &c.scene, SIZE_MAX, &options, frame)),
            "count is 18446744073709551615, must be in 0..2147483647");
  EXPECT_EQ(ErrorOf(tilegrad_render(renderer, nullptr, 2147483647, &options, frame)),
            "scene 0: scene is NULL");
  tilegrad_images images;
  tilegrad_images_init(&images);
  ASSERT_EQ(tilegrad_frame_images(frame, &images), TILEGRAD_OK);
  EXPECT_EQ(images.alpha, nullptr);
  tilegrad_frame_gradients d_frame;
  tilegrad_frame_gradients_init(&d_frame);
  tilegrad_scene_gradients d_scene;
  tilegrad_scene_gradients_init(&d_scene);
  EXPECT_EQ(ErrorOf(tilegrad_backward(renderer, frame, &d_frame, &d_scene, 1, 0)),
            "the frame holds nothing: Render into it first");
  ASSERT_EQ(Render(), TILEGRAD_OK);
  EXPECT_EQ(ErrorOf(tilegrad_backward(renderer, frame, &d_frame, &d_scene, 2, 0)),
            "count is 2, expected 1: one per scene");
}

// The C interface under random calls (c_caller.h). What must not happen shows under valgrind or the
// address sanitizer, too.
//
// A failure names its seed. More of them: TILEGRAD_SECONDS, TILEGRAD_SEED, and the test
// api_c_hostile_long.

// Two that work, and numbers that are none.
Caller MakeCaller(std::uint64_t seed) { return {Dice(seed), {1, 2, 0, -1, 5000}}; }

std::uint64_t FromEnvironment(const char* name, std::uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

void CallAtRandom(std::uint64_t seed) {
  constexpr int kCalls = 4000;
  Caller caller = MakeCaller(seed);
  for (int i = 0; i < kCalls; ++i) {
    SCOPED_TRACE("seed " + std::to_string(seed) + ", call " + std::to_string(i));
    caller.Call();
    ASSERT_FALSE(testing::Test::HasFailure());
  }
  // Not all is refused.
  EXPECT_GT(caller.good_renders(), kCalls / 10);
  EXPECT_GT(caller.good_backwards(), kCalls / 40);
}

// TILEGRAD_SECONDS: how long; TILEGRAD_SEED: the first.
void CallFor(std::uint64_t seconds) {
  mallopt(M_PERTURB, kPerturb);
  const auto end = std::chrono::steady_clock::now() +
                   std::chrono::seconds(FromEnvironment("TILEGRAD_SECONDS", seconds));
  std::uint64_t seed = FromEnvironment("TILEGRAD_SEED", 1);
  do {
    std::cout << "seed " << seed << std::endl;
    CallAtRandom(seed++);
  } while (std::chrono::steady_clock::now() < end && !testing::Test::HasFailure());
}

TEST(HostileC, CallsAreOkOrErrorsWithAMessage) { CallFor(0); }
TEST(HostileC, LongCallsAreToo) { CallFor(120); }

TEST(HostileC, CallersOnSeveralThreadsDoNotMeet) {
  std::vector<std::thread> threads;
  for (std::uint64_t seed = 11; seed < 14; ++seed) {
    threads.emplace_back([seed] {
      Caller caller = MakeCaller(seed);
      for (int i = 0; i < 500; ++i) caller.Call();
    });
  }
  for (std::thread& thread : threads) thread.join();
}

}  // namespace tilegrad::c_test
