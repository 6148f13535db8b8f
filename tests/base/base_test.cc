// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <new>
#include <set>
#include <thread>
#include <vector>

#include "base/aligned.h"
#include "base/file.h"
#include "base/inline_vector.h"
#include "base/parallel.h"
#include "base/rng.h"
#include "base/sanitizers.h"
#include "base/simd_target.h"
#include "support/forked.h"
#include "support/temp_folder.h"

namespace tilegrad::base_test {

TEST(Workers, CallsEachIndexOnceAndNeverTwoAtATimePerWorker) {
  for (int count : {1, 2, 3, 7}) {
    Workers workers(count);
    std::vector<std::atomic<int>> calls(1000), busy(static_cast<std::size_t>(count));
    workers.For(calls.size(), [&](std::size_t i, std::size_t w) {
      ASSERT_LT(w, busy.size());
      ASSERT_EQ(busy[w]++, 0);
      ++calls[i];
      --busy[w];
    });
    for (const auto& c : calls) EXPECT_EQ(c, 1);
  }
}

// Threads that wait for the rest of an inner loop could take waiting tasks of the outer one. Inner
// tasks sleep, so that other workers take some of them.
TEST(Workers, AWorkerThatWaitsForANestedLoopTakesNoOtherTask) {
  const Workers workers(4);
  std::vector<std::atomic<int>> busy(4);
  std::atomic<int> overlaps = 0, total = 0;
  for (int round = 0; round < 20; ++round) {
    workers.For(20, [&](std::size_t, std::size_t w) {
      if (busy[w]++ != 0) ++overlaps;
      workers.For(4, [&](std::size_t j, std::size_t) {
        std::this_thread::sleep_for(std::chrono::microseconds(100 * j));
        ++total;
      });
      --busy[w];
    });
  }
  EXPECT_EQ(overlaps, 0);
  EXPECT_EQ(total, 20 * 20 * 4);
}

TEST(Workers, PartsShareTheirLoops) {
  for (const int count : {1, 2, 3, 7}) {
    for (const std::size_t parts : {1, 2, 7, 20}) {
      const Workers workers(count);
      std::vector<std::atomic<int>> calls(parts * 30), busy(static_cast<std::size_t>(count));
      std::vector<std::atomic<int>> owned(static_cast<std::size_t>(count));
      std::atomic<int> overlaps = 0;
      workers.ForParts(parts, [&](std::size_t p, const Workers::Part& part) {
        if (owned.at(part.worker())++ != 0) ++overlaps;
        for (std::size_t loop = 0; loop < 3; ++loop) {
          part.For(10, [&](std::size_t i, std::size_t worker) {
            if (busy.at(worker)++ != 0) ++overlaps;
            ++calls[p * 30 + loop * 10 + i];
            --busy.at(worker);
          });
        }
        --owned.at(part.worker());
      });
      EXPECT_EQ(overlaps, 0);
      for (const auto& c : calls) EXPECT_EQ(c, 1);
    }
  }
}

// One part has much to do, the others nothing. Tasks sleep, so that other workers take some. On a
// busy machine threads may arrive late: the part continues until one has.
TEST(Workers, WithoutAPartTheyTakeThoseOfOthers) {
  const Workers workers(3);
  const bool sharing = !kThreadSanitizer;  // loops on threads of their own do not share
  std::vector<std::atomic<int>> tasks(3);
  const auto at_work = [&] {
    return std::count_if(tasks.begin(), tasks.end(), [](const auto& n) { return n > 0; });
  };
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  int loops = 0;
  workers.ForParts(3, [&](std::size_t p, const Workers::Part& part) {
    if (p != 0) return;
    do {
      ++loops;
      part.For(8, [&](std::size_t, std::size_t worker) {
        std::this_thread::sleep_for(std::chrono::microseconds(100));
        ++tasks.at(worker);
      });
    } while (sharing && at_work() == 1 && std::chrono::steady_clock::now() < deadline);
  });
  EXPECT_EQ(tasks[0] + tasks[1] + tasks[2], 8 * loops);
  if (sharing) {
    EXPECT_GT(at_work(), 1);
  }
}

// Sums of a nested loop by index, on `workers`; each worker's scratch is used by one task at a
// time.
std::vector<std::size_t> NestedSums(const Workers& workers) {
  std::vector<std::size_t> sums(50);
  std::vector<std::atomic<int>> busy(static_cast<std::size_t>(workers.count()));
  workers.For(sums.size(), [&](std::size_t i, std::size_t worker) {
    if (++busy.at(worker) != 1) std::abort();
    std::atomic<std::size_t> sum = 0;
    workers.For(i + 1, [&](std::size_t j, std::size_t) { sum += j; });
    sums[i] = sum;
    --busy[worker];
  });
  return sums;
}

// Workers created in the parent, and new ones, in a child and in a grandchild.
TEST(Workers, SurviveAFork) {
  if (const char* why = test::WhyNoFork()) GTEST_SKIP() << why;
  const auto before = std::make_unique<Workers>(4);
  const std::vector<std::size_t> expected = NestedSums(*before);
  const auto same = [&] {
    const Workers fresh(3);
    return NestedSums(fresh) == expected && NestedSums(*before) == expected &&
           NestedSums(fresh) == expected;
  };
  for (int round = 0; round < 20; ++round) {
    // The fork comes while oneTBB's threads are on their way to sleep.
    EXPECT_EQ(NestedSums(*before), expected);
    EXPECT_TRUE(test::TrueInChild([&] { return same() && test::TrueInChild(same); }));
  }
  EXPECT_EQ(NestedSums(*before), expected);
}

// A child, too, has several Workers at once, and destroys those of its parent.
TEST(Workers, AChildHasThreadsOfItsOwn) {
  if (const char* why = test::WhyNoFork()) GTEST_SKIP() << why;
  auto before = std::make_unique<Workers>(4);
  NestedSums(*before);
  EXPECT_TRUE(test::TrueInChild([&] {
    std::atomic<int> here = 0;
    before->For(4, [&](std::size_t, std::size_t) {
      ++here;
      while (here < 4) std::this_thread::yield();
    });
    before.reset();
    return true;
  }));
}

// oneTBB prints a warning if it provides fewer threads than workers.
TEST(Workers, OfSeveralCountsBeyondTheCoresPrintNothing) {
  testing::internal::CaptureStderr();
  {
    const int cores = AvailableCores();
    const Workers few(cores + 1), many(cores + 9), some(cores + 5);
    for (const Workers* workers : {&few, &many, &some}) NestedSums(*workers);
  }
  const Workers more(AvailableCores() + 17);
  NestedSums(more);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

// Running out of memory in a task reaches the caller, in a forked child as elsewhere.
bool ThrowsWhatATaskThrows(const Workers& workers) {
  std::atomic<int> calls = 0;
  try {
    workers.For(100, [&](std::size_t i, std::size_t) {
      ++calls;
      if (i % 10 == 7) throw std::bad_alloc();
    });
  } catch (const std::bad_alloc&) {
    return calls <= 100 && NestedSums(workers) == NestedSums(Workers(1));
  }
  return false;
}

TEST(Workers, WhatATaskThrowsComesOut) {
  for (int count : {1, 2, 5}) {
    const Workers workers(count);
    NestedSums(workers);
    for (int round = 0; round < 100; ++round) EXPECT_TRUE(ThrowsWhatATaskThrows(workers)) << count;
    if (test::WhyNoFork() != nullptr) continue;
    EXPECT_TRUE(test::TrueInChild([&] { return ThrowsWhatATaskThrows(workers); })) << count;
  }
}

TEST(Workers, RangesDependOnSizeAndGrainOnly) {
  for (int count : {1, 5}) {
    Workers workers(count);
    std::vector<std::size_t> ends(4);
    workers.ForRanges(10, 3, [&](std::size_t b, std::size_t e, std::size_t) { ends[b / 3] = e; });
    EXPECT_EQ(ends, (std::vector<std::size_t>{3, 6, 9, 10}));
  }
}

TEST(Workers, TasksNeedNoWorker) {
  const Workers workers(3);
  EXPECT_EQ(workers.size(), 3u);
  std::vector<int> calls(10);
  workers.For(10, [&](std::size_t i) { ++calls[i]; });
  workers.ForRanges(10, 3, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) ++calls[i];
  });
  workers.ForEach(10, 3, [&](std::size_t i) { ++calls[i]; });
  EXPECT_EQ(calls, std::vector<int>(10, 3));
}

TEST(Rng, StreamsAreReproducible) {
  Rng a(7, 3), b(7, 3), other(7, 4);
  for (int i = 0; i < 10; ++i) a.Next();
  for (int i = 0; i < 10; ++i) b.Next();
  EXPECT_EQ(a.Next(), b.Next());
  EXPECT_NE(Rng(7, 3).Next(), other.Next());
}

TEST(Rng, MomentsOfUniformAndNormal) {
  Rng rng(1);
  double sum = 0, normal = 0, squares = 0;
  const int n = 200000;
  for (int i = 0; i < n; ++i) {
    sum += rng.Uniform();
    const double z = rng.Normal();
    normal += z;
    squares += z * z;
  }
  // Five standard errors: 5 * sqrt(1/12/n), 5 / sqrt(n), 5 * sqrt(2/n).
  EXPECT_NEAR(sum / n, 0.5, 5 * std::sqrt(1.0 / 12 / n));
  EXPECT_NEAR(normal / n, 0, 5 / std::sqrt(n));
  EXPECT_NEAR(squares / n, 1, 5 * std::sqrt(2.0 / n));
}

TEST(Rng, BelowCoversItsRange) {
  Rng rng(2);
  std::set<std::uint64_t> seen;
  for (int i = 0; i < 200; ++i) seen.insert(rng.Below(6));
  EXPECT_EQ(seen, (std::set<std::uint64_t>{0, 1, 2, 3, 4, 5}));
}

TEST(Arena, ReusesMemoryAfterReset) {
  Arena arena;
  for (int round = 0; round < 2; ++round) {
    arena.Reset();
    for (int i = 0; i < 10; ++i) {
      auto span = arena.Allocate<float>(50000);
      EXPECT_EQ(reinterpret_cast<std::uintptr_t>(span.data()) % kAlignment, 0u);
    }
  }
  arena.Reset();
  const std::size_t held = arena.capacity();
  for (int i = 0; i < 10; ++i) (void)arena.Allocate<float>(50000);
  EXPECT_EQ(arena.capacity(), held);
}

// Elements moved to the heap are not also kept alive by the object's own slots.
TEST(InlineVector, HoldsEachElementOnce) {
  const auto shared = std::make_shared<int>(1);
  InlineVector<std::shared_ptr<int>, 2> list;
  for (int i = 0; i < 5; ++i) list.push_back(shared);
  EXPECT_EQ(shared.use_count(), 6);
  list.resize(1);
  EXPECT_EQ(shared.use_count(), 2);
}

class FileTest : public TempFolderTest {};

TEST_F(FileTest, WritesWholeAndReadsBack) {
  const Path path = folder_ / "a" / "b.txt";
  ASSERT_TRUE(WriteTextAtomic(path, "one").ok());
  ASSERT_TRUE(WriteTextAtomic(path, "two").ok());
  EXPECT_EQ(ReadText(path).value(), "two");
  ASSERT_TRUE(AppendText(path, "!", true).ok());
  EXPECT_EQ(ReadText(path).value(), "two!");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(path.parent_path()), {}),
            1);  // no temporary left
}

TEST_F(FileTest, ErrorsNameThePath) {
  const auto missing = ReadFile(folder_ / "none");
  EXPECT_EQ(missing.status().code(), StatusCode::kNotFound);
  ExpectMessage(missing.status(), "none");
  ASSERT_TRUE(WriteTextAtomic(folder_ / "big", "12345").ok());
  EXPECT_EQ(ReadFile(folder_ / "big", 4).status().code(), StatusCode::kResourceExhausted);
  EXPECT_EQ(ReadFile(folder_).status().code(), StatusCode::kInvalidArgument);
  // Opening a pipe without a writer does not block.
  ASSERT_EQ(::mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  EXPECT_EQ(ReadFile(folder_ / "pipe").status().code(), StatusCode::kInvalidArgument);
}

TEST_F(FileTest, LinksAndPipesStayWhatTheyAre) {
  ASSERT_TRUE(WriteTextAtomic(folder_ / "real", "old").ok());
  std::filesystem::create_symlink("real", folder_ / "link");
  ASSERT_TRUE(WriteTextAtomic(folder_ / "link", "new").ok());
  EXPECT_TRUE(std::filesystem::is_symlink(folder_ / "link"));
  EXPECT_EQ(ReadText(folder_ / "real").value(), "new");
  const Path pipe = folder_ / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const int end = ::open(pipe.c_str(), O_RDWR | O_NONBLOCK);  // a reader, so that writing can begin
  ASSERT_GE(end, 0);
  ASSERT_TRUE(WriteTextAtomic(pipe, "through").ok());
  char text[16] = {};
  EXPECT_EQ(::read(end, text, sizeof(text)), 7);
  EXPECT_STREQ(text, "through");
  ::close(end);
  EXPECT_TRUE(std::filesystem::is_fifo(pipe));
}

TEST_F(FileTest, NamesOfTheGreatestLength) {
  for (const std::size_t length : {240u, 255u}) {
    ASSERT_TRUE(WriteTextAtomic(folder_ / std::string(length, 'n'), "x").ok()) << length;
    EXPECT_EQ(ReadText(folder_ / std::string(length, 'n')).value(), "x");
  }
  // Temporaries differ even if the names share a long prefix.
  EXPECT_NE(TemporaryOf(std::string(254, 'n') + "a"), TemporaryOf(std::string(254, 'n') + "b"));
}

// Of dead processes, and of our own process number: in a container the next run may get it again.
TEST_F(FileTest, WhatKilledWritesLeftIsRemoved) {
  const std::string gone = "4194305";  // beyond the kernel's largest number of a process
  const std::string own = std::to_string(::getpid()), parent = std::to_string(::getppid());
  for (const std::string& name : {"a." + gone + ".tmp", "b." + own + ".tmp"})
    ASSERT_TRUE(AppendText(folder_ / name, "half", false).ok());
  const std::vector<std::string> others = {"c." + parent + ".tmp", "notes.tmp", "d." + gone,
                                           "e.12x.tmp", gone + ".tmp"};
  for (const std::string& name : others)
    ASSERT_TRUE(AppendText(folder_ / name, "whole", false).ok());
  RemoveTemporaries(folder_);
  RemoveTemporaries(folder_ / "none");
  for (const std::string& name : others) EXPECT_TRUE(std::filesystem::exists(folder_ / name));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), {}),
            static_cast<std::ptrdiff_t>(others.size()));
}

TEST_F(FileTest, FailedWriteLeavesTheOldFile) {
  const Path path = folder_ / "f";
  ASSERT_TRUE(WriteTextAtomic(path, "old").ok());
  // The temporary cannot be renamed over a folder that is not empty.
  ASSERT_TRUE(WriteTextAtomic(folder_ / "d" / "x", "x").ok());
  EXPECT_FALSE(WriteTextAtomic(folder_ / "d", "new").ok());
  EXPECT_EQ(ReadText(folder_ / "d" / "x").value(), "x");
  // /dev/full refuses every byte.
  EXPECT_EQ(AppendText("/dev/full", "x", false).code(), StatusCode::kIo);
}

TEST(SimdTarget, ForcesEveryRunnableTargetAndRefusesOthers) {
  const auto targets = RunnableTargets();
  ASSERT_FALSE(targets.empty());
  for (const auto& name : targets) {
    ASSERT_TRUE(ForceTarget(name).ok());
    EXPECT_EQ(ActiveTarget(), name);
    EXPECT_EQ(RunnableTargets(), targets);
  }
  EXPECT_EQ(ForceTarget("AVX9").code(), StatusCode::kInvalidArgument);
  ASSERT_TRUE(ForceTarget("").ok());
  EXPECT_EQ(ActiveTarget(), targets.front());
}

}  // namespace tilegrad::base_test
