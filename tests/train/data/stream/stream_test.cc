// SPDX-License-Identifier: Apache-2.0
// Streamed pictures: what is drawn by lot stays in its range, nothing drawn is the dataset's
// picture, and the same position gives the same bits for any worker.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <set>
#include <thread>

#include "base/error.h"
#include "base/parallel.h"
#include "render/picture/mesh_pictures.h"
#include "render/picture/mesh_scene.h"
#include "scene/shapes.h"
#include "support/expect.h"
#include "train/data/stream/mesh_cache.h"
#include "train/data/stream/object_draw.h"
#include "train/data/stream/textured_stream.h"

namespace tilegrad::train::stream_test {

// Nothing is left to chance but the azimuth.
StreamConfig Still() {
  StreamConfig c;
  c.share = 1;
  c.stretch = c.taper = c.roll = c.jitter = 0;
  c.recolor = c.brightness = c.light = 0;
  c.elevation_low = c.elevation_high = 27;
  c.fov_low = c.fov_high = Lens{}.fov_y;
  return c;
}

constexpr std::size_t kRoom = 1 << 30;

Mesh Ball() {
  Mesh ball = Icosphere(2, 0.45f);
  for (const glm::vec3& p : ball.positions) ball.colors.emplace_back(glm::vec3(0.5f) + p, 1.0f);
  return ball;
}

MeshCache Balls(std::size_t count) {
  return {count, kRoom, [](std::size_t) { return Result<TexturedMesh>(TexturedMesh(Ball())); }};
}

TexturedStream::Job JobOf(const StreamConfig& config, int size, std::uint64_t seed) {
  TexturedStream::Job job{.config = {.draw = config, .meshes = {}},
                          .light = {},
                          .camera = {},
                          .size = size,
                          .seed = seed,
                          .dataset_light = true};
  job.camera.lens.width = job.camera.lens.height = size;
  return job;
}

DatasetInfo Info(int size) {
  DatasetInfo info;
  info.image_size = info.camera.lens.width = info.camera.lens.height = size;
  return info;
}

TEST(AxisWarp, WithoutStretchNothingMoves) {
  Rng rng(1);
  const AxisWarp warp(rng, 0.45, 0, false);
  for (const float x : {-0.45f, -0.2f, 0.0f, 0.1f, 0.45f}) EXPECT_FLOAT_EQ(warp(x), x);
}

TEST(AxisWarp, GrowsByItsFactorsAndKeepsSymmetry) {
  constexpr double kStretch = 0.5;
  bool lopsided = false;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    Rng rng(seed);
    const AxisWarp even(rng, 0.45, kStretch, true), odd(rng, 0.45, kStretch, false);
    float before = even(-0.45f);
    for (float x = -0.44f; x < 0.45f; x += 0.01f) {
      const float now = even(x), slope = (now - before) / 0.01f;
      EXPECT_GT(slope, 0.999f * std::exp(-0.5f));
      EXPECT_LT(slope, 1.001f * std::exp(0.5f));
      EXPECT_NEAR(even(-x), -now, 1e-6f);
      before = now;
    }
    lopsided |= std::abs(odd(0.45f) + odd(-0.45f)) > 0.05f;
  }
  EXPECT_TRUE(lopsided);
}

TEST(ObjectDraw, FillsTheBoxAndStaysInRange) {
  StreamConfig config;
  config.stretch = 1;
  config.recolor = 1;
  config.brightness = 1;
  config.taper = 1;
  std::vector<glm::vec3> positions;
  const Mesh ball = Ball();
  bool deformed = false;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    Rng rng(seed);
    DrawShape(config, ball.positions, 0.45f, rng, &positions);
    const Recolor recolor(config, rng);
    glm::vec3 low(1), high(-1);
    for (const glm::vec3& p : positions) {
      low = glm::min(low, p);
      high = glm::max(high, p);
    }
    const glm::vec3 half = 0.5f * (high - low), centre = 0.5f * (high + low);
    EXPECT_NEAR(std::max({half.x, half.y, half.z}), 0.45f, 1e-6f);
    EXPECT_LT(glm::length(centre), 1e-6f);
    deformed |= std::min({half.x, half.y, half.z}) < 0.3f;
    for (const glm::vec4& color : ball.colors) {
      const glm::vec3 c = recolor(glm::vec3(color));
      for (int i = 0; i < 3; ++i) EXPECT_TRUE(c[i] >= 0 && c[i] <= 1) << c[i];
    }
  }
  EXPECT_TRUE(deformed);
}

// A hue that is turned keeps its luminance in YIQ, 0.299 r + 0.587 g + 0.114 b, and so does a tint,
// as long as nothing is cut at 0 or 1.
TEST(ObjectDraw, OtherHuesHaveTheSameLuminance) {
  StreamConfig config = Still();
  config.recolor = 1;
  const glm::vec3 color(0.45f, 0.4f, 0.35f);
  const float luminance = 0.299f * 0.45f + 0.587f * 0.4f + 0.114f * 0.35f;
  int kept = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    Rng rng(seed);
    const glm::vec3 c = Recolor(config, rng)(color);
    if (std::max({c.r, c.g, c.b}) == 1) continue;
    EXPECT_NEAR(0.299f * c.r + 0.587f * c.g + 0.114f * c.b, luminance, 2e-3f);
    EXPECT_GT(glm::length(c - color), 1e-4f);
    ++kept;
  }
  EXPECT_GT(kept, 25);
}

TEST(ViewDraw, WithoutChanceItIsAnOrbit) {
  const DatasetInfo info = Info(64);
  Rng rng(5);
  const Camera camera = DrawCamera(Still(), info.camera, 0, rng);
  // The eye is at the rule's distance and elevation, and looks at the origin.
  glm::vec3 eye(0);
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k)
      eye[i] -= camera.rotation[3 * k + i] * camera.translation[static_cast<std::size_t>(k)];
  }
  EXPECT_NEAR(glm::length(eye), 1.45f, 1e-5f);
  EXPECT_NEAR(eye.y, 1.45f * std::sin(27 * 3.14159265f / 180), 1e-5f);
  EXPECT_NEAR(camera.translation[0], 0, 1e-6f);
  EXPECT_NEAR(camera.translation[1], 0, 1e-6f);
  EXPECT_FLOAT_EQ(camera.cx, 32);
  EXPECT_FLOAT_EQ(camera.fx, Camera(info.camera.View(0)).fx);
}

// The dataset's own camera, but for the azimuth.
TEST(ViewDraw, FixedCamerasAreTheDatasets) {
  StreamConfig config;
  config.fixed_camera = true;
  const DatasetInfo info = Info(64);
  const Camera dataset = info.camera.View(0);
  Rng rng(5);
  std::set<float> azimuths;
  for (std::size_t view = 0; view < 3; ++view) {
    const Camera camera = DrawCamera(config, info.camera, view, rng);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(camera.translation[i], dataset.translation[i], 1e-6f);
    EXPECT_EQ(camera.fx, dataset.fx);
    EXPECT_EQ(camera.cy, dataset.cy);
    EXPECT_NEAR(camera.rotation[4], dataset.rotation[4], 1e-6f);  // cosine of the elevation
    azimuths.insert(camera.rotation[0]);
  }
  EXPECT_EQ(azimuths.size(), 3u);
}

// A square that faces the camera at the origin has the same size through any lens.
TEST(ViewDraw, TheDistanceFollowsTheLens) {
  StreamConfig config = Still();
  config.fov_low = 20;
  config.fov_high = 80;
  config.roll = 20;
  const DatasetInfo info = Info(64);
  const float want = info.camera.View(0).fx / 1.45f;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Rng rng(seed);
    const Camera camera = DrawCamera(config, info.camera, seed % 3, rng);
    EXPECT_NEAR(camera.fx / -camera.translation[2], want, 1e-4f * want);
  }
}

// The height of the eye over its distance is the sine of the elevation.
TEST(ViewDraw, OtherViewsHaveTheirOwnElevations) {
  StreamConfig config;
  config.elevation_low = 10;
  config.elevation_high = 20;
  config.around_low = -40;
  config.around_high = -30;
  const DatasetInfo info = Info(64);
  const auto elevation = [&](std::size_t view, std::uint64_t seed) {
    Rng rng(seed);
    const Camera camera = DrawCamera(config, info.camera, view, rng);
    float height = 0;
    for (std::size_t k = 0; k < 3; ++k)
      height -= camera.rotation[3 * k + 1] * camera.translation[k];
    const auto& t = camera.translation;
    return std::asin(height / std::hypot(t[0], t[1], t[2])) * 180 / 3.14159265f;
  };
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    EXPECT_NEAR(elevation(0, seed), 15, 5.001f);
    EXPECT_NEAR(elevation(1, seed), -35, 5.001f);
    EXPECT_NEAR(elevation(2, seed), -35, 5.001f);
  }
}

TEST(ViewDraw, LightsComeFromAbove) {
  StreamConfig config = Still();
  const auto still = [&] {
    Rng rng(1);
    return DrawLights(config, rng);
  }();
  for (std::size_t i = 0; i < 2; ++i) {
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_NEAR(still[i].direction[k], DatasetLights()[i].direction[k], 1e-6f);
  }
  config.light = 1;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    Rng rng(seed);
    for (const Light& light : DrawLights(config, rng)) {
      EXPECT_GE(light.direction[1], std::sin(4.99f * 3.14159265f / 180));
      EXPECT_NEAR(std::hypot(light.direction[0], light.direction[1], light.direction[2]), 1, 1e-5f);
    }
  }
}

// At most half a step of 8 bits from the picture of the dataset's renderer, which is rounded to
// them; and flat normals there are ours.
TEST(DatasetLitStream, WithoutChanceItIsTheDatasetsPicture) {
  constexpr int kSize = 32;
  StreamConfig config = Still();
  config.samples = 4;
  const Workers workers(1);
  const MeshCache balls = Balls(1);
  TexturedStream stream(JobOf(config, kSize, 7), balls, workers);
  std::vector<TexturedView> views(3);
  const auto rgba = Ok(stream.Render(0, 0, 0, views));
  std::vector<Camera> cameras;
  for (const TexturedView& view : views) cameras.push_back(view.camera);
  LitRenderer lit;
  const auto want = Ok(lit.Render(Ball(), cameras, kSize));
  ASSERT_EQ(rgba->size(), want->size());
  for (std::size_t i = 0; i < want->size(); ++i)
    EXPECT_NEAR(255 * (*rgba)[i], (*want)[i], 0.51f) << i;
}

TEST(DatasetLitStream, DependsOnSeedAndPositionOnly) {
  constexpr int kSize = 16;
  StreamConfig config;
  config.share = 0.5;
  const Workers two(2);
  const MeshCache balls = Balls(2);
  TexturedStream a(JobOf(config, kSize, 7), balls, two), b(JobOf(config, kSize, 7), balls, two),
      other(JobOf(config, kSize, 8), balls, two);
  EXPECT_EQ(a.Count(8), 4u);
  std::vector<TexturedView> views(2), again(2);
  const auto draw = [&](TexturedStream& s, std::uint64_t position, std::size_t worker,
                        std::vector<TexturedView>& to) {
    const auto rgba = *s.Render(1, position, worker, to);
    return std::vector<float>(rgba.begin(), rgba.end());
  };
  const auto first = draw(a, 3, 0, views);
  draw(b, 9, 1, again);  // a worker that has drawn something else before
  EXPECT_EQ(first, draw(b, 3, 1, again));
  EXPECT_EQ(std::memcmp(&views[1].camera, &again[1].camera, sizeof(Camera)), 0);
  EXPECT_NE(first, draw(a, 4, 0, again));
  EXPECT_NE(first, draw(other, 3, 0, again));
}

TEST(DatasetLitStream, ASheetShowsAllOfIt) {
  const Workers workers(1);
  const MeshCache balls = Balls(3);
  TexturedStream stream(JobOf({}, 16, 7), balls, workers);
  const auto sheet = Ok(stream.Sheet(2, 3));
  EXPECT_EQ(sheet->width, 3 * 16 + 2 * 4);
  EXPECT_EQ(sheet->height, 2 * 16 + 4);
}

// Meshes that are read when they are wanted.

constexpr std::size_t kCount = 6;

// Boxes that are told apart by their width, and how often each was read.
struct Source {
  std::array<std::atomic<int>, kCount> reads = {};
  std::atomic<bool> broken = false;

  Result<TexturedMesh> Read(std::size_t i) {
    ++reads[i];
    if (broken) return DataLoss("box {} is broken", i);
    return TexturedMesh(Box(glm::vec3(0), {static_cast<float>(i + 1), 1, 1}));
  }
  MeshCache CacheOf(std::size_t meshes) {
    const std::size_t bytes = TexturedMesh(Box(glm::vec3(0), glm::vec3(1))).bytes();
    return {kCount, meshes * bytes, [this](std::size_t i) { return Read(i); }};
  }
};

float WidthOf(const MeshCache& cache, std::size_t i) {
  return 2 * Ok(cache.Get(i)).value()->mesh().positions[7].x;
}

TEST(MeshCache, TheLeastRecentlyUsedLeaves) {
  Source source;
  const MeshCache cache = source.CacheOf(2);
  for (const std::size_t i : {0, 1, 0, 2}) EXPECT_EQ(WidthOf(cache, i), WidthOf(cache, i));
  EXPECT_TRUE(cache.full());
  EXPECT_EQ(cache.bytes(), 2 * Ok(cache.Get(0)).value()->bytes());
  EXPECT_EQ(source.reads[0], 1);
  EXPECT_EQ(source.reads[1], 1);
  (void)cache.Get(1);  // left for 2
  EXPECT_EQ(source.reads[1], 2);
}

TEST(MeshCache, AMeshThatIsHeldStaysThoughItsPlaceIsGone) {
  Source source;
  const MeshCache none = source.CacheOf(0);
  const auto held = Ok(none.Get(3)).value();
  EXPECT_EQ(none.bytes(), 0u);
  EXPECT_NE(WidthOf(none, 4), WidthOf(none, 3));
  EXPECT_EQ(source.reads[3], 2);
  EXPECT_EQ(held->mesh().faces.size(), 12u);
}

// Readers hold lists of files.
TEST(MeshCache, LetsItsReaderGoOnceAllAreThereToStay) {
  Source source;
  for (const std::size_t room : {kCount - 1, kCount}) {
    const auto list = std::make_shared<int>(0);
    const std::size_t bytes = TexturedMesh(Box(glm::vec3(0), glm::vec3(1))).bytes();
    const MeshCache cache(kCount, room * bytes,
                          [list, &source](std::size_t i) { return source.Read(i); });
    for (std::size_t i = 0; i < kCount; ++i) EXPECT_TRUE(cache.Get(i).ok());
    EXPECT_EQ(list.use_count(), room == kCount ? 1 : 2);
    EXPECT_NE(WidthOf(cache, 1), WidthOf(cache, 2));
  }
}

TEST(MeshCache, ReadsAheadWhatIsExpected) {
  Source source;
  const MeshCache cache = source.CacheOf(3);
  for (const std::size_t i : {0, 1, 2, 3}) (void)cache.Get(i);
  cache.Expect({5, 4});
  for (int wait = 0; wait < 2000 && source.reads[4] == 0; ++wait)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  (void)cache.Get(4);
  (void)cache.Get(5);
  EXPECT_EQ(source.reads[4], 1);
  EXPECT_EQ(source.reads[5], 1);
}

TEST(MeshCache, ThreadsThatWantTheSameShareOneRead) {
  Source source;
  const MeshCache cache = source.CacheOf(kCount);
  Workers(4).For(100, [&](std::size_t i, std::size_t) {
    cache.Expect({(i + 1) % kCount});
    EXPECT_EQ(WidthOf(cache, i % kCount), WidthOf(cache, i % kCount));
  });
  for (const auto& reads : source.reads) EXPECT_EQ(reads, 1);
}

TEST(MeshCache, AnErrorIsForWhoeverAsksAndIsNotKept) {
  Source source;
  const MeshCache cache = source.CacheOf(kCount);
  source.broken = true;
  cache.Expect({2});
  ExpectMessage(cache.Get(2).status(), "box 2 is broken");
  source.broken = false;
  EXPECT_TRUE(cache.Get(2).ok());
}

}  // namespace tilegrad::train::stream_test
