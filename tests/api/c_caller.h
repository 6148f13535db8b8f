// SPDX-License-Identifier: Apache-2.0
// Calls of the C interface as dice fall, most of them wrong. Each is OK or an error with a message,
// and a frame holds images only after a render that was OK: all that were asked for, every number
// of them written, the same bits as from a renderer and a frame that are new. The same holds of
// gradients. Every array ends where its memory ends.
#pragma once

#include <gtest/gtest.h>
#include <tilegrad/c.h>

#include <algorithm>
#include <bit>
#include <climits>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace tilegrad {

// What random calls choose by: the same choices from the same seed, or from the same bytes.
// The multiplier and increment are Knuth's for 64 bits (MMIX); the high bits are the random ones.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : state_(seed) {}
  // Two bytes a choice; once they are used up, as by a seed that is their number.
  explicit Dice(std::span<const std::uint8_t> bytes) : state_(bytes.size()), bytes_(bytes) {}
  std::uint32_t Next() {
    if (bytes_.size() >= 2) {
      const std::uint32_t value = bytes_[0] + 256u * bytes_[1];
      bytes_ = bytes_.subspan(2);
      return value;
    }
    state_ = state_ * 6364136223846793005u + 1442695040888963407u;
    return static_cast<std::uint32_t>(state_ >> 33);
  }
  bool used_up() const { return bytes_.size() < 2; }
  bool OneIn(std::uint32_t n) { return Next() % n == 0; }
  template <class T>
  T Of(std::initializer_list<T> values) {
    return values.begin()[Next() % values.size()];
  }
  float Number() {
    if (OneIn(4000)) return Of({NAN, INFINITY, -INFINITY, 3e38f, -1e30f, 1e-42f});
    return static_cast<float>(Next() % 20001) / 10000.0f - 1.0f;
  }

 private:
  std::uint64_t state_;
  std::span<const std::uint8_t> bytes_;
};

// All that one render was given. A float* of `arrays` has no spare room behind it.
struct World {
  std::vector<std::unique_ptr<float[]>> floats;
  std::vector<std::unique_ptr<std::int32_t[]>> ints;
  std::vector<std::vector<tilegrad_texture>> textures;
  std::vector<std::vector<tilegrad_surface>> surfaces;
  std::vector<std::vector<tilegrad_light>> lights;
  std::vector<tilegrad_scene> scenes;
  tilegrad_options options;

  float* Floats(Dice* dice, std::size_t count) {
    floats.push_back(std::make_unique<float[]>(count));
    for (std::size_t i = 0; i < count; ++i) floats.back()[i] = dice->Number();
    return floats.back().get();
  }
  std::int32_t* Indices(Dice* dice, std::size_t count, std::size_t end) {
    ints.push_back(std::make_unique<std::int32_t[]>(count));
    for (std::size_t i = 0; i < count; ++i) {
      const auto index = static_cast<std::int32_t>(dice->Next() % std::max<std::size_t>(end, 1));
      ints.back()[i] = dice->OneIn(300) ? dice->Of({-1, INT_MAX, INT_MIN, 17}) : index;
    }
    return ints.back().get();
  }
};

inline tilegrad_stream RandomStream(Dice* dice, World* world, const tilegrad_scene& scene,
                                    std::size_t width) {
  if (dice->OneIn(2)) return {nullptr, dice->Of({0, 1, 9})};
  const bool corner = dice->OneIn(3);
  const std::size_t rows = corner ? 3 * scene.face_count : scene.vertices;
  return {world->Floats(dice, rows * width), corner};
}

inline std::vector<tilegrad_texture> RandomTextures(Dice* dice, World* world) {
  std::vector<tilegrad_texture> out(dice->Of<std::size_t>({0, 0, 1, 2}));
  for (tilegrad_texture& t : out) {
    t = {nullptr, dice->Of({1, 2, 5, 8}), dice->Of({1, 3, 8}), dice->Of({0, 1, 2}),
         dice->Of({0, 1, 2})};
    t.texels = world->Floats(dice, 3 * static_cast<std::size_t>(t.width * t.height));
    if (dice->OneIn(20)) t.width = dice->Of({0, -1, 20000, INT_MAX, INT_MIN});
    if (dice->OneIn(20)) t.height = dice->Of({0, -7, 16385, INT_MAX});
    if (dice->OneIn(20)) t.wrap = dice->Of({-1, 9, INT_MAX});
    if (dice->OneIn(20)) t.filter = dice->Of({-1, 3, INT_MIN});
    if (dice->OneIn(20)) t.texels = nullptr;
  }
  return out;
}

inline std::vector<tilegrad_surface> RandomSurfaces(Dice* dice, std::size_t textures) {
  std::vector<tilegrad_surface> out(dice->Of<std::size_t>({0, 0, 1, 3}));
  for (tilegrad_surface& s : out) {
    float* const numbers = s.base_color;
    for (int i = 0; i < 13; ++i) numbers[i] = std::abs(dice->Number());
    s.texture = textures == 0 ? -1 : static_cast<std::int32_t>(dice->Next() % textures);
    if (dice->OneIn(40)) s.texture = dice->Of({-2, 5, INT_MAX});
  }
  return out;
}

inline void FillCamera(Dice* dice, tilegrad_camera* camera) {
  camera->fx = 20 + 5 * dice->Number();
  camera->fy = 20;
  camera->cx = 12;
  camera->cy = 9;
  camera->translation[2] = dice->Of({-2.0f, -0.5f, 0.3f});
  if (dice->OneIn(60)) camera->near_plane = dice->Of({0.0f, -1.0f, NAN, 1e30f});
  if (dice->OneIn(60)) camera->fx = dice->Of({0.0f, -1.0f, NAN, 1e30f, 1e-30f});
  if (dice->OneIn(60)) camera->rotation[dice->Next() % 9] = dice->Of({NAN, 0.0f, 1e38f});
}

inline tilegrad_scene RandomScene(Dice* dice, World* world) {
  tilegrad_scene s;
  tilegrad_scene_init(&s);
  s.vertices = dice->Of<std::size_t>({0, 1, 3, 5, 16, 40});
  s.face_count = s.vertices == 0 ? 0 : dice->Of<std::size_t>({0, 1, 2, 7, 30});
  s.positions = world->Floats(dice, 3 * s.vertices);
  s.faces = world->Indices(dice, 3 * s.face_count, s.vertices);
  FillCamera(dice, &s.camera);
  s.colors = RandomStream(dice, world, s, 3);
  s.uvs = RandomStream(dice, world, s, 2);
  s.normals = RandomStream(dice, world, s, 3);
  s.channels = dice->Of({0, 0, 1, 4});
  if (s.channels > 0) {
    s.attributes = RandomStream(dice, world, s, static_cast<std::size_t>(s.channels));
  }
  if (dice->OneIn(60)) s.channels = dice->Of({-1, INT_MAX, INT_MIN});
  world->textures.push_back(RandomTextures(dice, world));
  if (s.uvs.values == nullptr && !dice->OneIn(10)) world->textures.back().clear();
  s.textures = world->textures.back().data();
  s.texture_count = world->textures.back().size();
  world->surfaces.push_back(RandomSurfaces(dice, s.texture_count));
  s.surfaces = world->surfaces.back().data();
  s.surface_count = world->surfaces.back().size();
  if (dice->OneIn(2)) s.face_surfaces = world->Indices(dice, s.face_count, s.surface_count);
  s.lighting = dice->Of({0, 0, 1, 2, 3});
  s.normal_kind = s.normals.values == nullptr ? dice->Of({0, 1}) : dice->Of({0, 1, 2});
  s.two_sided = dice->Of({0, 1, -5});
  s.clamp = dice->Of({0, 1});
  world->lights.emplace_back(dice->Of<std::size_t>({1, 1, 2}));
  for (tilegrad_light& l : world->lights.back()) l = {{dice->Number(), 1, dice->Number()}, 1};
  const bool lamps = dice->OneIn(2);
  if (lamps) {
    s.lights = world->lights.back().data();
    s.light_count = world->lights.back().size();
  }
  if (!lamps) s.light_directions = world->Floats(dice, 3 * s.vertices);
  if (!dice->OneIn(20)) s.sh = world->Floats(dice, 9);
  if (dice->OneIn(30)) s.lighting = dice->Of({-1, 4, INT_MAX});
  if (dice->OneIn(30)) s.normal_kind = dice->Of({-1, 2, 3});
  if (dice->OneIn(30)) s.positions = nullptr;
  if (dice->OneIn(30)) s.faces = nullptr;
  if (dice->OneIn(30)) s.lights = nullptr;
  if (dice->OneIn(30)) s.surfaces = nullptr;
  if (dice->OneIn(40)) s.vertices = dice->Of<std::size_t>({SIZE_MAX, SIZE_MAX / 3 + 1});
  if (dice->OneIn(40)) s.light_count = SIZE_MAX;
  if (dice->OneIn(40)) s.struct_size = dice->Of<std::size_t>({0, 7, 8, 65537, SIZE_MAX, 64, 200});
  return s;
}

inline std::unique_ptr<World> RandomWorld(Dice* dice) {
  auto world = std::make_unique<World>();
  const int count = dice->Of({0, 1, 1, 1, 2, 3});
  for (int n = 0; n < count; ++n) {
    // A batch of alike scenes, mostly: others are refused at once.
    world->scenes.push_back(n > 0 && !dice->OneIn(3) ? world->scenes[0]
                                                     : RandomScene(dice, world.get()));
  }
  tilegrad_options& o = world->options;
  tilegrad_options_init(&o);
  o.width = dice->Of({1, 7, 24, 33, 70});
  o.height = dice->Of({1, 5, 18, 65});
  o.delta = dice->Of({1e-3, 1.0 / 7000, 10.0, 1e-12});
  o.max_alpha_error = dice->Of({0.0, 1e-6, 0.1, 1.0});
  for (std::int32_t* wanted :
       {&o.color, &o.alpha, &o.attributes, &o.depth, &o.normals, &o.uv, &o.barycentrics}) {
    *wanted = dice->Of({0, 1, 1, -1});
  }
  o.culling = dice->Of({0, 0, 1});
  o.interpolation = dice->Of({0, 0, 1});
  o.alpha_rule = dice->Of({0, 0, 1});
  if (dice->OneIn(40)) o.width = dice->Of({0, -1, INT_MAX, INT_MIN, 16385});
  if (dice->OneIn(40)) o.delta = dice->Of<double>({0, -1, NAN, INFINITY, 1e-320, 1e308});
  if (dice->OneIn(40)) o.max_alpha_error = dice->Of<double>({-1, 2, NAN});
  if (dice->OneIn(40)) o.culling = dice->Of({-1, 2, INT_MAX});
  if (dice->OneIn(40)) o.alpha_rule = dice->Of({-1, 2});
  if (dice->OneIn(40)) o.paper_box = dice->Of<double>({-1, NAN, 1e300});
  if (dice->OneIn(40)) o.paper_faces = dice->Of({-1, 0, INT_MAX});
  if (dice->OneIn(40)) o.struct_size = dice->Of<std::size_t>({0, 5, 8, 24, 65537});
  return world;
}

// glibc fills what it hands out with the complement of this byte.
inline constexpr int kPerturb = 0x01;
inline constexpr std::uint32_t kNotWritten = 0xFEFEFEFE;

inline bool IsWritten(float x) { return std::bit_cast<std::uint32_t>(x) != kNotWritten; }
inline bool AllWritten(std::span<const float> values) {
  return std::all_of(values.begin(), values.end(), IsWritten);
}

// A scene of an older struct_size as the library reads it: the fields behind its end are those of
// tilegrad_scene_init, whatever stands there.
inline tilegrad_scene AsRead(const tilegrad_scene& given) {
  tilegrad_scene out;
  tilegrad_scene_init(&out);
  std::memcpy(&out, &given, std::min(given.struct_size, sizeof out));
  return out;
}

// Every image that was asked for, in the order of options.
inline std::vector<std::span<const float>> Planes(const tilegrad_images& i) {
  const auto pixels =
      static_cast<std::size_t>(i.count) * static_cast<std::size_t>(i.height * i.width);
  std::vector<std::span<const float>> out;
  const struct {
    const float* image;
    int planes;
  } all[] = {{i.color, 3},   {i.alpha, 1}, {i.attributes, i.channels}, {i.depth, 1},
             {i.normals, 3}, {i.uv, 2},    {i.barycentrics, 2}};
  for (const auto& a : all) {
    out.emplace_back(a.image, a.image == nullptr ? 0 : static_cast<std::size_t>(a.planes) * pixels);
  }
  return out;
}

// A frame and what it looks at.
struct Shot {
  tilegrad_frame* frame = tilegrad_frame_create();
  std::unique_ptr<World> world = std::make_unique<World>();
  ~Shot() { tilegrad_frame_destroy(frame); }
};

class Caller {
 public:
  // The first two renderers are called most.
  Caller(const Dice& dice, std::initializer_list<int> threads) : dice_(dice), shots_(3) {
    for (const int count : threads) {
      renderers_.push_back(tilegrad_renderer_create(count));
    }
  }
  ~Caller() {
    for (tilegrad_renderer* renderer : renderers_) tilegrad_renderer_destroy(renderer);
  }

  void Call() {
    tilegrad_renderer* renderer = dice_.OneIn(50) ? nullptr : renderers_[Pick(renderers_.size())];
    if (!dice_.OneIn(4)) renderer = renderers_[Pick(2)];
    Shot* shot = &shots_[Pick(shots_.size())];
    if (dice_.OneIn(60)) return Replace();
    if (dice_.OneIn(2)) return Render(renderer, shot);
    Backward(renderer, *shot);
  }
  bool used_up() const { return dice_.used_up(); }
  int good_renders() const { return good_renders_; }
  int good_backwards() const { return good_backwards_; }

 private:
  std::size_t Pick(std::size_t end) { return dice_.Next() % end; }

  void Replace() {
    tilegrad_renderer*& old = renderers_[Pick(2)];
    tilegrad_renderer_destroy(old);
    old = tilegrad_renderer_create(dice_.Of({1, 2, 3}));
    tilegrad_renderer_destroy(nullptr);
    tilegrad_frame_destroy(nullptr);
  }

  void ExpectMessage(tilegrad_renderer* renderer, tilegrad_status status) {
    const std::string message = tilegrad_last_error(renderer);
    if (renderer == nullptr) {
      EXPECT_EQ(status, TILEGRAD_INVALID_ARGUMENT);
      return;
    }
    EXPECT_EQ(message.empty(), status == TILEGRAD_OK) << message;
    EXPECT_TRUE(status == TILEGRAD_OK || status == TILEGRAD_INVALID_ARGUMENT ||
                status == TILEGRAD_RESOURCE_EXHAUSTED)
        << status << ": " << message;
  }

  void Render(tilegrad_renderer* renderer, Shot* shot) {
    std::unique_ptr<World> world = RandomWorld(&dice_);
    const bool no_frame = dice_.OneIn(50), no_options = dice_.OneIn(50);
    const bool no_scenes = dice_.OneIn(50);
    const std::size_t count =
        no_scenes && dice_.OneIn(2) ? std::size_t{1} << 30 : world->scenes.size();
    const tilegrad_status status =
        tilegrad_render(renderer, no_scenes ? nullptr : world->scenes.data(), count,
                        no_options ? nullptr : &world->options, no_frame ? nullptr : shot->frame);
    ExpectMessage(renderer, status);
    good_renders_ += status == TILEGRAD_OK;
    if (no_frame || renderer == nullptr) return;  // the frame was not touched
    shot->world = std::move(world);
    ExpectImages(*shot, status == TILEGRAD_OK);
    if (status == TILEGRAD_OK && dice_.OneIn(4)) ExpectSameAnew(*shot, no_options);
  }

  // A renderer and a frame that are new give the same bits.
  void ExpectSameAnew(const Shot& shot, bool no_options) {
    const World& world = *shot.world;
    tilegrad_renderer* const renderer = tilegrad_renderer_create(dice_.Of({1, 2}));
    tilegrad_frame* const frame = tilegrad_frame_create();
    EXPECT_EQ(tilegrad_render(renderer, world.scenes.data(), world.scenes.size(),
                              no_options ? nullptr : &world.options, frame),
              TILEGRAD_OK);
    tilegrad_images anew, before;
    tilegrad_images_init(&anew);
    tilegrad_images_init(&before);
    ASSERT_EQ(tilegrad_frame_images(frame, &anew), TILEGRAD_OK);
    ASSERT_EQ(tilegrad_frame_images(shot.frame, &before), TILEGRAD_OK);
    const auto a = Planes(anew), b = Planes(before);
    for (std::size_t i = 0; i < a.size(); ++i) {
      ASSERT_EQ(a[i].size(), b[i].size()) << i;
      EXPECT_TRUE(a[i].empty() || std::memcmp(a[i].data(), b[i].data(), a[i].size_bytes()) == 0)
          << "image " << i;
    }
    tilegrad_frame_destroy(frame);
    tilegrad_renderer_destroy(renderer);
  }

  void ExpectImages(const Shot& shot, bool rendered) {
    tilegrad_images images;
    tilegrad_images_init(&images);
    if (dice_.OneIn(20)) images.struct_size = offsetof(tilegrad_images, color);
    ASSERT_EQ(tilegrad_frame_images(shot.frame, &images), TILEGRAD_OK);
    const bool some = rendered && !shot.world->scenes.empty();
    EXPECT_EQ(images.face_ids != nullptr, some);
    if (!some || images.struct_size != sizeof images) return;
    const auto pixels = static_cast<std::size_t>(images.count) *
                        static_cast<std::size_t>(images.height * images.width);
    const tilegrad_options& o = shot.world->options;
    if (o.struct_size == sizeof o && images.width == o.width) {  // not those of no options
      EXPECT_EQ(images.color != nullptr, o.color != 0);
      EXPECT_EQ(images.uv != nullptr, o.uv != 0);
      EXPECT_EQ(images.normals != nullptr, o.normals != 0);
      EXPECT_EQ(images.depth != nullptr, o.depth != 0);
    }
    for (const auto plane : Planes(images)) EXPECT_TRUE(AllWritten(plane));
    for (std::size_t i = 0; i < pixels; ++i) {
      ASSERT_GE(images.face_ids[i], -1);
      if (images.alpha == nullptr) continue;
      ASSERT_TRUE(images.alpha[i] >= 0 && images.alpha[i] <= 1);
    }
  }

  // NULL, an array of `size`, or now and then one that something else was given, too.
  float* Wanted(World* scratch, std::size_t size, bool given) {
    if (!given && !dice_.OneIn(60)) return nullptr;
    if (dice_.OneIn(3)) return nullptr;
    const std::size_t numbers = given ? size : 1;
    const std::span<float> own(scratch->Floats(&dice_, numbers), numbers);
    if (!shared_.empty() && dice_.OneIn(30)) return shared_[Pick(shared_.size())].data();
    if (given && size > 0) shared_.push_back(own);
    return own.data();
  }

  // The arrays that a backward pass is to write, behind each other.
  std::vector<float> Written(const World& scratch) const {
    std::vector<float> out;
    for (const auto array : shared_) out.insert(out.end(), array.begin(), array.end());
    for (const auto& list : scratch.lights) {
      for (const tilegrad_light& l : list) out.push_back(l.intensity);
    }
    return out;
  }
  void FillGradients(World* scratch, float value) const {
    for (const auto array : shared_) std::fill(array.begin(), array.end(), value);
    for (auto& list : scratch->lights) {
      for (tilegrad_light& l : list) l.intensity = value;
    }
  }

  tilegrad_scene_gradients RandomGradients(World* scratch, const tilegrad_scene& s) {
    const auto stream = [&](const tilegrad_stream& t, std::size_t width) {
      const std::size_t rows = t.per_corner != 0 ? 3 * s.face_count : s.vertices;
      return Wanted(scratch, rows * width, t.values != nullptr);
    };
    tilegrad_scene_gradients d;
    tilegrad_scene_gradients_init(&d);
    d.positions = Wanted(scratch, 3 * s.vertices, true);
    d.colors = stream(s.colors, 3);
    d.uvs = stream(s.uvs, 2);
    d.normals = stream(s.normals, 3);
    d.attributes = stream(s.attributes, static_cast<std::size_t>(std::max(s.channels, 0)));
    d.light_directions = Wanted(scratch, 3 * s.vertices, s.light_directions != nullptr);
    d.sh = Wanted(scratch, 9, s.sh != nullptr);
    if (dice_.OneIn(2)) d.camera = &camera_;
    return d;
  }

  tilegrad_frame_gradients RandomCotangents(World* scratch, const tilegrad_images& images) {
    tilegrad_frame_gradients d_frame;
    tilegrad_frame_gradients_init(&d_frame);
    const auto pixels = static_cast<std::size_t>(images.count) *
                        static_cast<std::size_t>(images.height * images.width);
    const auto image = [&](std::size_t width, const float* given) -> const float* {
      if (given == nullptr && !dice_.OneIn(30)) return nullptr;
      return dice_.OneIn(3) ? nullptr : scratch->Floats(&dice_, width * pixels);
    };
    d_frame.color = image(3, images.color);
    d_frame.alpha = image(1, images.alpha);
    d_frame.attributes = image(static_cast<std::size_t>(images.channels), images.attributes);
    d_frame.depth = image(1, images.depth);
    d_frame.normals = image(3, images.normals);
    d_frame.uv = image(2, images.uv);
    if (dice_.OneIn(50)) d_frame.struct_size = dice_.Of<std::size_t>({0, 3, 8, SIZE_MAX});
    return d_frame;
  }

  void Backward(tilegrad_renderer* renderer, const Shot& shot) {
    tilegrad_images images;
    tilegrad_images_init(&images);
    ASSERT_EQ(tilegrad_frame_images(shot.frame, &images), TILEGRAD_OK);
    const World& world = *shot.world;
    World scratch;
    shared_.clear();
    std::vector<tilegrad_scene_gradients> d;
    std::vector<std::vector<float*>> textures;
    const bool rendered = images.face_ids != nullptr;
    for (const tilegrad_scene& s : world.scenes) {
      d.push_back(RandomGradients(&scratch, rendered ? AsRead(s) : tilegrad_scene()));
      if (!rendered || s.struct_size != sizeof s) continue;
      textures.emplace_back();
      for (std::size_t t = 0; t < s.texture_count; ++t) {
        const tilegrad_texture& texture = s.textures[t];
        const auto texels = static_cast<std::size_t>(texture.width * texture.height);
        textures.back().push_back(Wanted(&scratch, 3 * texels, true));
      }
      if (s.texture_count > 0 || dice_.OneIn(60)) d.back().textures = textures.back().data();
      scratch.surfaces.emplace_back(std::max<std::size_t>(s.surface_count, 1));
      scratch.lights.emplace_back(s.light_count);
      if (dice_.OneIn(2)) d.back().surfaces = scratch.surfaces.back().data();
      if (dice_.OneIn(2)) d.back().lights = scratch.lights.back().data();
      if (d.back().lights == nullptr) scratch.lights.back().clear();
    }
    const tilegrad_frame_gradients d_frame = RandomCotangents(&scratch, images);
    std::size_t count = d.size();
    if (dice_.OneIn(50)) count = dice_.Of<std::size_t>({0, 2, SIZE_MAX});
    const std::int32_t add = dice_.Of({0, 1, -1});
    const bool no_frame = dice_.OneIn(50), no_d_frame = dice_.OneIn(50), no_d = dice_.OneIn(50);
    const auto call = [&](tilegrad_renderer* on) {
      return tilegrad_backward(on, no_frame ? nullptr : shot.frame, no_d_frame ? nullptr : &d_frame,
                               no_d ? nullptr : d.data(), count, add);
    };
    if (add == 0) FillGradients(&scratch, NAN);
    const tilegrad_status status = call(renderer);
    ExpectMessage(renderer, status);
    if (status == TILEGRAD_OK && add == 0 && count > 0) ExpectSameGradientsAnew(call, &scratch);
    good_backwards_ += status == TILEGRAD_OK && count > 0;
  }

  // All are numbers, and the same ones from a renderer that is new.
  template <class Call>
  void ExpectSameGradientsAnew(const Call& call, World* scratch) {
    const std::vector<float> before = Written(*scratch);
    for (const float x : before) ASSERT_TRUE(std::isfinite(x) && IsWritten(x)) << x;
    FillGradients(scratch, NAN);
    tilegrad_renderer* const renderer = tilegrad_renderer_create(dice_.Of({1, 2}));
    EXPECT_EQ(call(renderer), TILEGRAD_OK);
    tilegrad_renderer_destroy(renderer);
    const std::vector<float> anew = Written(*scratch);
    EXPECT_TRUE(before.empty() ||
                std::memcmp(before.data(), anew.data(), before.size() * sizeof(float)) == 0);
  }

  Dice dice_;
  std::vector<tilegrad_renderer*> renderers_;
  std::vector<Shot> shots_;
  tilegrad_camera camera_ = {};
  std::vector<std::span<float>> shared_;  // arrays of gradients
  int good_renders_ = 0, good_backwards_ = 0;
};

}  // namespace tilegrad
