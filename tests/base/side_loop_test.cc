// SPDX-License-Identifier: Apache-2.0
#include "base/side_loop.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <vector>

#include "base/loop_trace.h"
#include "support/forked.h"

namespace tilegrad::side_loop_test {

using namespace std::chrono_literals;

// Counts the calls of each task, and lanes that two tasks have at once.
struct Calls {
  Calls(std::size_t tasks, std::size_t lanes) : of_task(tasks), busy(lanes) {}
  SideLoop::Task Task() {
    return [this](std::size_t i, std::size_t lane) {
      if (lane >= busy.size() || busy[lane]++ != 0) ++overlaps;
      std::this_thread::sleep_for(20us);
      ++of_task[i];
      --busy[lane];
    };
  }
  void ExpectOnce() const {
    EXPECT_EQ(overlaps, 0);
    for (const auto& calls : of_task) EXPECT_EQ(calls, 1);
  }
  std::vector<std::atomic<int>> of_task, busy;
  std::atomic<int> overlaps = 0;
};

TEST(SideLoop, CallsEachTaskOnceBesideOtherLoops) {
  for (const int count : {1, 2, 3, 16}) {
    const Workers workers(count);
    SideLoop loop(workers);
    for (int round = 0; round < 20; ++round) {
      Calls calls(40, SideLoop::LanesOf(workers));
      loop.Begin(40, calls.Task());
      std::atomic<int> sum = 0;
      for (int i = 0; i < 5; ++i) workers.For(10, [&](std::size_t, std::size_t) { ++sum; });
      EXPECT_EQ(sum, 50);
      loop.Finish();
      calls.ExpectOnce();
    }
  }
}

TEST(SideLoop, OneWorkerBeginsNothingBeforeFinish) {
  const Workers workers(1);
  SideLoop loop(workers);
  EXPECT_EQ(SideLoop::LanesOf(workers), 1u);
  Calls calls(3, 1);
  loop.Begin(3, calls.Task());
  EXPECT_EQ(calls.of_task[0], 0);
  loop.Finish();
  calls.ExpectOnce();
}

TEST(SideLoop, AnotherWorkerTakesTasksWhileTheCallerIsBusy) {
  const Workers workers(2);
  SideLoop loop(workers);
  std::atomic<int> done = 0;
  loop.Begin(3, [&](std::size_t, std::size_t) { ++done; });
  for (int i = 0; i < 2000 && done < 3; ++i) std::this_thread::sleep_for(5ms);
  EXPECT_EQ(done, 3);
  loop.Finish();
}

TEST(SideLoop, ThrowsWhatATaskHasThrown) {
  for (const int count : {1, 2}) {
    const Workers workers(count);
    SideLoop loop(workers);
    loop.Begin(3, [](std::size_t i, std::size_t) {
      if (i == 1) throw std::runtime_error("task 1");
    });
    EXPECT_THROW(loop.Finish(), std::runtime_error);
    Calls calls(3, SideLoop::LanesOf(workers));  // and the next one is as if nothing had been
    loop.Begin(3, calls.Task());
    loop.Finish();
    calls.ExpectOnce();
  }
}

TEST(SideLoop, EndsWithoutTasksThatHaveNotBegun) {
  const Workers workers(2);
  std::atomic<int> running = 0, done = 0;
  {
    SideLoop loop(workers);
    loop.Begin(1000, [&](std::size_t, std::size_t) {
      ++running;
      std::this_thread::sleep_for(1ms);
      --running;
      ++done;
    });
    std::this_thread::sleep_for(3ms);
  }
  EXPECT_EQ(running, 0);
  EXPECT_LT(done, 1000);
}

// Where oneTBB cannot be used.
TEST(SideLoop, WorksInAForkedChild) {
  if (const char* why = test::WhyNoFork()) GTEST_SKIP() << why;
  const Workers workers(3);
  workers.For(6, [](std::size_t, std::size_t) {});
  EXPECT_TRUE(test::TrueInChild([&] {
    SideLoop loop(workers);
    Calls calls(30, SideLoop::LanesOf(workers));
    loop.Begin(30, calls.Task());
    loop.Finish();
    for (const auto& c : calls.of_task) {
      if (c != 1) return false;
    }
    return calls.overlaps == 0;
  }));
}

TEST(SideLoop, IsRecordedAsWhatItIs) {
  LoopTrace trace;
  const Workers workers(16, &trace);
  SideLoop loop(workers);
  trace.Begin();
  int calls = 0;
  loop.Begin(5, [&](std::size_t, std::size_t) { ++calls; });
  workers.For(2, [](std::size_t, std::size_t) {});
  loop.Finish();
  const Strand strand = trace.End();
  EXPECT_EQ(calls, 5);
  ASSERT_EQ(strand.loops.size(), 2u);
  EXPECT_EQ(strand.loops[0].tasks.size(), 5u);
  EXPECT_EQ(strand.loops[0].helpers, SideLoop::LanesOf(workers) - 16);
  EXPECT_EQ(strand.loops[1].helpers, 0u);
}

}  // namespace tilegrad::side_loop_test
