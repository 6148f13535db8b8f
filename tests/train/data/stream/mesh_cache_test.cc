// SPDX-License-Identifier: Apache-2.0
#include "train/data/stream/mesh_cache.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "base/error.h"
#include "base/parallel.h"
#include "scene/shapes.h"
#include "support/expect.h"

namespace tilegrad::train::mesh_cache_test {

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

}  // namespace tilegrad::train::mesh_cache_test
