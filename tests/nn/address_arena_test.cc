// SPDX-License-Identifier: Apache-2.0
#include "nn/address_arena.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <vector>

#include "base/aligned.h"
#include "base/rng.h"

namespace tilegrad::nn::address_arena_test {

constexpr std::size_t kMega = std::size_t{1} << 20;

TEST(AddressArena, TakesTheSmallestRangeThatFits) {
  AddressArena arena;
  std::byte* a = arena.Allocate(4 * kMega);
  std::byte* b = arena.Allocate(kMega);
  std::byte* c = arena.Allocate(2 * kMega);
  std::byte* d = arena.Allocate(kMega);
  arena.Free(a, 4 * kMega);
  arena.Free(c, 2 * kMega);
  EXPECT_EQ(arena.Allocate(kMega), c);
  EXPECT_EQ(arena.Allocate(3 * kMega), a);
  EXPECT_EQ(arena.growths(), 4u);
  EXPECT_EQ(arena.held(), 8 * kMega);
  arena.Free(b, kMega);
  arena.Free(d, kMega);
}

TEST(AddressArena, FreeNeighboursJoinWhateverTheOrder) {
  const std::vector<std::vector<int>> orders = {{0, 1, 2}, {2, 1, 0}, {0, 2, 1}, {1, 0, 2}};
  for (const auto& order : orders) {
    AddressArena arena;
    std::byte* blocks[3];
    for (std::byte*& block : blocks) block = arena.Allocate(kMega);
    for (const int i : order) arena.Free(blocks[i], kMega);
    EXPECT_EQ(arena.Allocate(3 * kMega), blocks[0]);
    EXPECT_EQ(arena.held(), 3 * kMega);
  }
}

TEST(AddressArena, GrowsByWhatIsMissingBehindAFreeEnd) {
  AddressArena arena;
  std::byte* a = arena.Allocate(kMega);
  std::byte* b = arena.Allocate(kMega);
  arena.Free(b, kMega);
  EXPECT_EQ(arena.Allocate(5 * kMega), b);
  EXPECT_EQ(arena.held(), 6 * kMega);
  arena.Free(a, kMega);
}

TEST(AddressArena, WithoutMemoryItIsAsBefore) {
  AddressArena arena;
  std::byte* const first = arena.Allocate(1 << 20);
  const std::size_t held = arena.held();
  EXPECT_THROW(arena.Allocate(std::size_t{1} << 60), std::bad_alloc);
  EXPECT_EQ(arena.held(), held);
  arena.Free(first, 1 << 20);
  EXPECT_EQ(arena.Allocate(1 << 20), first);
}

TEST(AddressArena, TrimmedMemoryIsThereAgain) {
  AddressArena arena;
  std::byte* a = arena.Allocate(8 * kMega);
  std::memset(a, 7, 8 * kMega);
  arena.Free(a, 8 * kMega);
  arena.Trim();
  EXPECT_EQ(arena.Allocate(8 * kMega), a);
  std::memset(a, 9, 8 * kMega);
  EXPECT_EQ(a[8 * kMega - 1], std::byte{9});
}

// Blocks of any size never overlap, are aligned, and rounds that repeat need no more memory.
TEST(AddressArena, RepeatedRoundsHoldNoMore) {
  struct Block {
    std::byte* data;
    std::size_t bytes;
    unsigned char mark;
  };
  AddressArena arena;
  std::size_t held = 0;
  for (int round = 0; round < 6; ++round) {
    Rng rng(11);
    std::vector<Block> live;
    const auto give = [&](std::size_t i) {
      const Block b = live[i];
      EXPECT_EQ(b.data[0], std::byte{b.mark});
      EXPECT_EQ(b.data[b.bytes - 1], std::byte{b.mark});
      arena.Free(b.data, b.bytes);
      live.erase(live.begin() + static_cast<std::ptrdiff_t>(i));
    };
    for (int i = 0; i < 400; ++i) {
      if (!live.empty() && rng.Below(5) < 2) give(rng.Below(live.size()));
      const std::size_t bytes = 1 + rng.Below(rng.Below(4) == 0 ? 3 * kMega : 3000);
      const auto mark = static_cast<unsigned char>(i);
      live.push_back({arena.Allocate(bytes), bytes, mark});
      EXPECT_EQ(reinterpret_cast<std::uintptr_t>(live.back().data) % kAlignment, 0u);
      std::memset(live.back().data, mark, bytes);
    }
    while (!live.empty()) give(0);
    if (round == 1) held = arena.held();
    EXPECT_TRUE(round < 2 || arena.held() == held) << round;
  }
}

}  // namespace tilegrad::nn::address_arena_test
