// SPDX-License-Identifier: Apache-2.0
#include "base/loop_team.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>
#include <vector>

#include "base/parallel.h"
#include "base/rng.h"

namespace tilegrad::loop_team_test {

using namespace std::chrono_literals;

// Loops within loops, as `seed` draws them; returns the number of innermost tasks.
std::size_t RunLoops(const Workers& workers, std::uint64_t seed, int depth) {
  const std::size_t n = 1 + Rng(seed).Next() % 9;
  std::vector<std::size_t> counts(n, 1);
  workers.For(n, [&](std::size_t i, std::size_t) {
    if (depth > 0) counts[i] = RunLoops(workers, 31 * seed + i, depth - 1);
  });
  std::size_t sum = 0;
  for (const std::size_t count : counts) sum += count;
  return sum;
}

TEST(LoopTeam, NestedLoopsGiveTheSameForAnyNumberOfWorkers) {
  const Workers one(1), two(2), many(16);
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    const std::size_t expected = RunLoops(one, seed, 3);
    EXPECT_EQ(RunLoops(two, seed, 3), expected);
    EXPECT_EQ(RunLoops(many, seed, 3), expected);
  }
}

// The worker's scratch is in use by its task, so a loop of one index within must not get another's.
TEST(LoopTeam, LoopsOfOneIndexKeepTheWorkerTheyAreOn) {
  for (const int count : {2, 3, 16}) {
    const Workers workers(count);
    std::atomic<int> there = 0, other = 0;
    workers.ForParts(2, [&](std::size_t, const Workers::Part& part) {
      ++there;
      const auto end = std::chrono::steady_clock::now() + 10s;
      while (there < 2 && std::chrono::steady_clock::now() < end) std::this_thread::yield();
      const auto compare = [&](std::size_t, std::size_t worker) {
        if (worker != part.worker()) ++other;
      };
      part.For(1, compare);
      workers.For(1, compare);
    });
    EXPECT_EQ(there, 2);
    EXPECT_EQ(other, 0) << count << " workers";
  }
}

TEST(LoopTeam, LoopsOfSeveralCallersRunOneAfterTheOther) {
  const Workers workers(3);
  std::vector<std::atomic<int>> busy(3);
  std::atomic<int> overlaps = 0, tasks = 0;
  const auto call = [&] {
    for (int round = 0; round < 50; ++round) {
      workers.For(round % 2 == 0 ? 7 : 1, [&](std::size_t, std::size_t worker) {
        if (busy[worker]++ != 0) ++overlaps;
        ++tasks;
        --busy[worker];
      });
    }
  };
  std::thread first(call), second(call);
  call();
  first.join();
  second.join();
  EXPECT_EQ(tasks, 3 * 25 * (7 + 1));
  EXPECT_EQ(overlaps, 0);
}

// A member that has been idle for long must be called again.
TEST(LoopTeam, CallsMembersThatHaveGone) {
  const Workers workers(2);
  for (int round = 0; round < 20; ++round) {
    std::atomic<int> there = 0;
    workers.For(2, [&](std::size_t, std::size_t) {
      ++there;
      const auto end = std::chrono::steady_clock::now() + 10s;
      while (there < 2 && std::chrono::steady_clock::now() < end) std::this_thread::yield();
    });
    EXPECT_EQ(there, 2);
    std::this_thread::sleep_for(1ms);
  }
}

}  // namespace tilegrad::loop_team_test
