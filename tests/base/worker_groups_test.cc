// SPDX-License-Identifier: Apache-2.0
#include "base/worker_groups.h"

#include <gtest/gtest.h>

#include <atomic>
#include <new>
#include <set>
#include <vector>

#include "base/loop_trace.h"
#include "support/forked.h"

namespace tilegrad::worker_groups_test {

TEST(WorkerGroups, ShareAllWorkersEvenly) {
  for (const int count : {1, 2, 3, 5, 16}) {
    const Workers workers(count);
    for (const std::size_t most :
         {std::size_t{1}, std::size_t{2}, std::size_t{4}, std::size_t{64}}) {
      const WorkerGroups groups(workers, most);
      ASSERT_EQ(groups.count(), std::min(most, static_cast<std::size_t>(count)));
      std::size_t at = 0;
      std::set<int> sizes;
      for (std::size_t g = 0; g < groups.count(); ++g) {
        EXPECT_EQ(groups.first(g), at);
        at += static_cast<std::size_t>(groups.group(g).count());
        sizes.insert(groups.group(g).count());
      }
      EXPECT_EQ(at, static_cast<std::size_t>(count));
      EXPECT_LE(*sizes.rbegin() - *sizes.begin(), 1);
    }
  }
}

// Loops of groups side by side: each index once, and no two workers with one number.
bool LoopsAreWhole(const Workers& workers, std::size_t most) {
  const WorkerGroups groups(workers, most);
  std::vector<std::atomic<int>> calls(groups.count() * 100);
  std::vector<std::atomic<int>> busy(static_cast<std::size_t>(workers.count()));
  std::atomic<int> overlaps = 0;
  for (int round = 0; round < 3; ++round) {
    groups.For([&](std::size_t g) {
      groups.group(g).For(100, [&](std::size_t i, std::size_t worker) {
        std::atomic<int>& mine = busy[groups.first(g) + worker];
        overlaps += mine++ > 0;
        ++calls[g * 100 + i];
        --mine;
      });
    });
  }
  for (const auto& c : calls) {
    if (c != 3) return false;
  }
  return overlaps == 0;
}

TEST(WorkerGroups, RunLoopsOfTheirOwn) {
  for (const int count : {1, 2, 5, 16}) {
    for (const std::size_t most : {std::size_t{1}, std::size_t{2}, std::size_t{4}, std::size_t{16}})
      EXPECT_TRUE(LoopsAreWhole(Workers(count), most)) << count << " workers, " << most;
  }
}

// Where oneTBB cannot be used.
TEST(WorkerGroups, WorkInAForkedChild) {
  if (const char* why = test::WhyNoFork()) GTEST_SKIP() << why;
  const Workers workers(4);
  workers.For(6, [](std::size_t, std::size_t) {});
  EXPECT_TRUE(test::TrueInChild([&] { return LoopsAreWhole(workers, 2); }));
}

TEST(WorkerGroups, PassOnWhatATaskThrows) {
  const Workers workers(2);
  const WorkerGroups groups(workers, 2);
  EXPECT_THROW(groups.For([](std::size_t g) {
    if (g == 1) throw std::bad_alloc();
  }),
               std::bad_alloc);
}

TEST(WorkerGroups, AreRecordedAsWhatTheyAre) {
  LoopTrace trace;
  const Workers workers(16, &trace);
  const WorkerGroups groups(workers, 4);
  trace.Begin();
  groups.For([&](std::size_t g) { groups.group(g).For(7, [](std::size_t, std::size_t) {}); });
  workers.For(2, [](std::size_t, std::size_t) {});
  const Strand strand = trace.End();
  ASSERT_EQ(strand.loops.size(), 2u);
  EXPECT_TRUE(strand.loops[0].grouped);
  ASSERT_EQ(strand.loops[0].tasks.size(), 4u);
  for (const Strand& task : strand.loops[0].tasks) {
    ASSERT_EQ(task.loops.size(), 1u);
    EXPECT_EQ(task.loops[0].tasks.size(), 7u);
    EXPECT_FALSE(task.loops[0].grouped);
  }
  EXPECT_FALSE(strand.loops[1].grouped);
}

}  // namespace tilegrad::worker_groups_test
