// SPDX-License-Identifier: Apache-2.0
#include "base/loop_schedule.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "base/clocks.h"

namespace tilegrad::loop_schedule_test {

Strand Task(double seconds) { return {{seconds}, {}}; }

LoopRecord Loop(const std::vector<double>& tasks, double bytes = 0) {
  LoopRecord loop{{"a/src/b.cc", 7}, bytes, {}};
  for (const double seconds : tasks) loop.tasks.push_back(Task(seconds));
  return loop;
}

double Makespan(const Strand& strand, int workers, double start = 0, double bandwidth = 0) {
  return Forecast(strand, {workers, start, bandwidth}).seconds;
}

TEST(LoopForecast, TasksGoToWhoeverIsFree) {
  const Strand strand{{1, 2}, {Loop({3, 3, 2, 2, 2})}};
  EXPECT_DOUBLE_EQ(Makespan(strand, 1), 1 + 12 + 2);
  EXPECT_DOUBLE_EQ(Makespan(strand, 2), 1 + 7 + 2);  // 3, 2, 2 beside 3, 2
  EXPECT_DOUBLE_EQ(Makespan(strand, 3), 1 + 5 + 2);  // 3, 2 beside 3 and 2, 2
  EXPECT_DOUBLE_EQ(Makespan(strand, 8), 1 + 3 + 2);
}

// Graham's bound is met: the great task comes last.
TEST(LoopForecast, AGreatTaskAtTheEndLeavesOthersIdle) {
  const Strand strand{{0, 0}, {Loop({1, 1, 1, 1, 1, 1, 3})}};
  EXPECT_DOUBLE_EQ(Makespan(strand, 3), 5);
}

TEST(LoopForecast, OthersComeLate) {
  const Strand strand{{0, 0}, {Loop({1, 1, 1, 1})}};
  EXPECT_DOUBLE_EQ(Makespan(strand, 2, 0.5), 2.5);  // 0..2 beside 0.5..2.5
  EXPECT_DOUBLE_EQ(Makespan(strand, 3, 0.5), 2.0);  // the third comes at 1
  EXPECT_DOUBLE_EQ(Makespan(strand, 4, 0.25), 1.5);
  EXPECT_DOUBLE_EQ(Makespan(strand, 4, 9.0), 4.0);  // it is done before any other comes
}

TEST(LoopForecast, MemoryIsACeiling) {
  const Strand strand{{0, 0, 0}, {Loop({1, 1, 1, 1}, 300), Loop({1, 1, 1, 1}, 30)}};
  EXPECT_DOUBLE_EQ(Makespan(strand, 4, 0, 100), 3 + 1);
  EXPECT_DOUBLE_EQ(Makespan(strand, 4, 0, 0), 1 + 1);
}

// Two tasks of which each has a loop of its own: with two workers they run it alone, with four
// others join in.
TEST(LoopForecast, LoopsWithinLoopsGoToIdleWorkers) {
  const Strand part{{1, 1}, {Loop({2, 2})}};
  const Strand strand{{0, 0}, {{{"c.cc", 1}, 0, {part, part}}}};
  EXPECT_DOUBLE_EQ(Makespan(strand, 1), 12);
  EXPECT_DOUBLE_EQ(Makespan(strand, 2), 6);
  EXPECT_DOUBLE_EQ(Makespan(strand, 4), 4);
}

// Three parts on two workers: the one that has none helps with the loop of the last.
TEST(LoopForecast, AWorkerWithoutAPartHelpsTheOther) {
  const Strand part{{1, 0}, {Loop({1, 1, 1, 1})}};
  const Strand strand{{0, 0}, {{{"c.cc", 1}, 0, {part, part, part}}}};
  EXPECT_DOUBLE_EQ(Makespan(strand, 2), 5 + 1 + 2);
}

LoopRecord SideLoopOf(const std::vector<double>& tasks, std::size_t helpers) {
  LoopRecord loop = Loop(tasks);
  loop.helpers = helpers;
  return loop;
}

TEST(LoopForecast, ASideLoopRunsBesideTheStrand) {
  const Strand strand{{1, 6}, {SideLoopOf({2, 2, 2}, 1)}};
  EXPECT_DOUBLE_EQ(Makespan(strand, 1), 13);
  EXPECT_DOUBLE_EQ(Makespan(strand, 2), 7);
  EXPECT_DOUBLE_EQ(Makespan(strand, 8), 7);
}

// One helper at a time, and all once the strand is over.
TEST(LoopForecast, WhatIsLeftOfASideLoopGoesToAll) {
  const Strand strand{{0, 2}, {SideLoopOf({2, 2, 2}, 1)}};
  EXPECT_DOUBLE_EQ(Makespan(strand, 2), 4);
  EXPECT_DOUBLE_EQ(Makespan(strand, 4), 4);
  EXPECT_DOUBLE_EQ(Makespan({{0, 2}, {SideLoopOf({2, 2, 2, 2}, 2)}}, 4), 4);
  EXPECT_DOUBLE_EQ(Makespan({{0, 2}, {SideLoopOf({2, 2, 2, 2}, 4)}}, 8), 2);
}

// The helper is away while the side loop lasts: 2 beside 1 and 1, then 1 and 1 beside each other.
TEST(LoopForecast, HelpersOfASideLoopMissInOthers) {
  const Strand strand{{0, 0, 0}, {SideLoopOf({2}, 1), Loop({1, 1, 1, 1})}};
  EXPECT_DOUBLE_EQ(Makespan(strand, 2), 3);
  EXPECT_DOUBLE_EQ(Makespan(strand, 5), 1 + 1);
}

// Four loops of 1 + 4 tasks + 1 in groups. The workers of one do not help another's.
TEST(LoopForecast, GroupsRunTheirOwnLoops) {
  const Strand small{{1, 1}, {Loop({1, 1, 1, 1})}}, large{{1, 1}, {Loop({2, 2, 2, 2})}};
  LoopRecord groups{{"c/src/d.cc", 1}, 0, {small, large}};
  groups.grouped = true;
  const Strand strand{{3, 4}, {groups}};
  EXPECT_DOUBLE_EQ(Makespan(strand, 2), 3 + (1 + 8 + 1) + 4);
  EXPECT_DOUBLE_EQ(Makespan(strand, 4), 3 + (1 + 4 + 1) + 4);
  EXPECT_DOUBLE_EQ(Makespan(strand, 8), 3 + (1 + 2 + 1) + 4);
  // A group begins half a second later, and its second worker half a second after it has a loop.
  EXPECT_DOUBLE_EQ(Makespan(strand, 4, 0.5), 3 + 0.5 + (1 + 4.5 + 1) + 4);
  const LoopForecast forecast = Forecast(strand, {4, 0.5, 0});
  double taken = 0;
  for (const HeldBack& place : forecast.places) taken += place.taken;
  EXPECT_DOUBLE_EQ(taken, forecast.seconds);
  const auto inner = std::ranges::find(forecast.places, "b.cc:7", &HeldBack::place);
  ASSERT_NE(inner, forecast.places.end());
  EXPECT_DOUBLE_EQ(inner->work, 2 * 8);
  EXPECT_DOUBLE_EQ(inner->wasted, 4.5 - 16.0 / 4);
}

TEST(LoopForecast, WastedTimeIsWhatIsMissingToAnEvenShare) {
  const Strand strand{{1, 2, 3}, {Loop({4, 4}), Loop({4, 1})}};
  const LoopForecast forecast = Forecast(strand, {2, 0, 0});
  double wasted = 0;
  for (const HeldBack& place : forecast.places) wasted += place.wasted;
  EXPECT_DOUBLE_EQ(forecast.seconds, 1 + 4 + 2 + 4 + 3);
  EXPECT_DOUBLE_EQ(wasted, forecast.seconds - WorkOf(strand) / 2);
  // Both loops stand in the same place.
  ASSERT_EQ(forecast.places.size(), 4u);
  EXPECT_EQ(forecast.places[0].place, "b.cc:7");
  EXPECT_EQ(forecast.places[0].times, 2);
  EXPECT_DOUBLE_EQ(forecast.places[0].work, 13);
  EXPECT_DOUBLE_EQ(forecast.places[0].wasted, 1.5);
  EXPECT_EQ(forecast.places[1].place, "b.cc:7 .. end");
  EXPECT_DOUBLE_EQ(forecast.places[1].wasted, 1.5);
}

void Spin(double seconds) {
  for (const double begin = ThreadSeconds(); ThreadSeconds() - begin < seconds;) {
  }
}

TEST(LoopTrace, SumsToTheTimeThatPassed) {
  LoopTrace trace;
  const Workers workers(4, &trace);
  EXPECT_EQ(workers.count(), 4);
  const double before = ThreadSeconds();
  trace.Begin();
  const double begin = ThreadSeconds();
  Spin(2e-3);
  workers.NoteTraffic(64);
  workers.For(5, [](std::size_t i, std::size_t) { Spin(1e-3 * static_cast<double>(i)); });
  workers.For(1, [](std::size_t, std::size_t) { Spin(1e-3); });  // no loop for others to help with
  workers.ForRanges(30, 10, [&](std::size_t, std::size_t, std::size_t) {
    workers.For(2, [](std::size_t, std::size_t) {});
  });
  const double passed = ThreadSeconds() - begin;
  const Strand strand = trace.End();
  const double most = ThreadSeconds() - before;
  ASSERT_EQ(strand.loops.size(), 2u);
  ASSERT_EQ(strand.stretches.size(), 3u);
  const int laps = 1 + (1 + 5) + 1 + 3 * (1 + 1 + 2);
  EXPECT_GE(WorkOf(strand), passed - laps * trace.reading_seconds() - 1e-9);
  EXPECT_LE(WorkOf(strand), most + 1e-9);
  EXPECT_GE(strand.stretches[0], 2e-3);
  EXPECT_GE(strand.stretches[1], 1e-3);
  ASSERT_EQ(strand.loops[0].tasks.size(), 5u);
  for (std::size_t i = 0; i < 5; ++i)
    EXPECT_GE(WorkOf(strand.loops[0].tasks[i]), 1e-3 * static_cast<double>(i));
  EXPECT_EQ(strand.loops[0].bytes, 64);
  EXPECT_EQ(strand.loops[1].bytes, 0);
  ASSERT_EQ(strand.loops[1].tasks.size(), 3u);
  for (const Strand& task : strand.loops[1].tasks) {
    ASSERT_EQ(task.loops.size(), 1u);
    EXPECT_EQ(task.loops[0].tasks.size(), 2u);
  }
}

TEST(LoopTrace, LeavesOutWhatItsClockCosts) {
  LoopTrace trace;
  const Workers workers(4, &trace);
  constexpr std::size_t kTasks = 20000;
  trace.Begin();
  workers.For(kTasks, [](std::size_t, std::size_t) {});
  EXPECT_GT(trace.reading_seconds(), 0);
  EXPECT_LT(WorkOf(trace.End()), 0.5 * kTasks * trace.reading_seconds());
}

TEST(LoopTrace, NamesTheLineOfTheLoop) {
  LoopTrace trace;
  const Workers workers(2, &trace);
  trace.Begin();
  const int line = __LINE__ + 1;
  workers.For(2, [](std::size_t, std::size_t) {});
  workers.ForParts(2, [](std::size_t, const Workers::Part& part) {
    part.For(2, [](std::size_t, std::size_t) {});
  });
  ForChunks(&workers, 4, 2, [](std::size_t, std::size_t) {});
  const Strand strand = trace.End();
  ASSERT_EQ(strand.loops.size(), 3u);
  EXPECT_EQ(strand.loops[0].site.line, line);
  EXPECT_EQ(strand.loops[1].site.line, line + 1);
  EXPECT_EQ(strand.loops[1].tasks[1].loops.at(0).site.line, line + 2);
  EXPECT_EQ(strand.loops[2].site.line, line + 4);
  EXPECT_TRUE(std::string_view(strand.loops[2].site.file).ends_with("loop_schedule_test.cc"));
}

TEST(LoopTrace, EachBeginForgets) {
  LoopTrace trace;
  const Workers workers(2, &trace);
  for (int i = 0; i < 2; ++i) {
    trace.Begin();
    workers.For(3, [](std::size_t, std::size_t) {});
    EXPECT_EQ(trace.End().loops.size(), 1u);
  }
}

TEST(LoopCosts, AreOfThisMachine) {
  const LoopCosts costs = MeasureLoopCosts(Workers(2));
  EXPECT_LT(costs.start_seconds, 0.1);
  EXPECT_GT(costs.bytes_per_second, 1e8);
}

}  // namespace tilegrad::loop_schedule_test
