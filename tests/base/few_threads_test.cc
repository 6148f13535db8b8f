// SPDX-License-Identifier: Apache-2.0
// Where the system refuses threads, fewer work: every index once, no crash, one notice. Each case
// in a process of its own, with support/few_threads.c as the system.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "base/parallel.h"
#include "support/forked.h"

namespace tilegrad::few_threads_test {

class FewThreads : public testing::TestWithParam<int> {
 protected:
  // In a child process to which `GetParam()` threads are granted.
  template <class Call>
  void InChild(const Call& call) {
    if (const char* why = test::WhyNoFork()) GTEST_SKIP() << why;
    const std::string granted = std::to_string(GetParam());
    EXPECT_TRUE(test::TrueInChild([&] {
      setenv("TILEGRAD_TEST_THREADS", granted.c_str(), 1);
      return call(GetParam());
    })) << granted;
  }
};

bool EachIndexOnce(const Workers& workers) {
  constexpr std::size_t kCount = 500;
  std::vector<std::atomic<int>> seen(kCount);
  std::atomic<bool> known = true;
  workers.For(kCount, [&](std::size_t i, std::size_t worker) {
    if (worker >= static_cast<std::size_t>(workers.count())) known = false;
    seen[i]++;
    std::this_thread::yield();
  });
  for (const auto& count : seen) known = known && count == 1;
  return known;
}

// Of `threads` granted and `wanted` workers.
bool Noticed(int threads, int wanted) {
  const bool first = TakeThreadNotice() != nullptr;
  return first == (threads < wanted - 1) && TakeThreadNotice() == nullptr;
}

TEST_P(FewThreads, DoTheWork) {
  InChild([](int granted) {
    const Workers workers(5);
    return workers.count() == std::min(5, granted + 1) && EachIndexOnce(workers) &&
           EachIndexOnce(workers) && Noticed(granted, 5);
  });
}

TEST_P(FewThreads, DoTheWorkOfSeveralAndOfWorkersThatCameLater) {
  InChild([](int granted) {
    const Workers a(3);
    auto b = std::make_unique<Workers>(4);
    if (a.count() != std::min(3, granted + 1) || b->count() != std::min(4, granted + 1)) {
      return false;
    }
    for (int i = 0; i < 20; ++i) {
      if (!EachIndexOnce(a) || !EachIndexOnce(*b)) return false;
      b = std::make_unique<Workers>(2 + i % 7);
    }
    return true;
  });
}

TEST_P(FewThreads, DoTheWorkOfNestedLoopsAndParts) {
  InChild([](int) {
    const Workers workers(4);
    std::atomic<int> sum = 0;
    workers.ForParts(6, [&](std::size_t, const Workers::Part& part) {
      part.For(50, [&](std::size_t, std::size_t) { ++sum; });
    });
    workers.For(6, [&](std::size_t, std::size_t) {
      workers.For(50, [&](std::size_t, std::size_t) { ++sum; });
    });
    return sum == 600;
  });
}

// oneTBB has threads here, and its child none but those that it may start.
TEST_P(FewThreads, DoTheWorkOfAForkedChild) {
  InChild([](int granted) {
    unsetenv("TILEGRAD_TEST_THREADS");
    const Workers workers(4);
    if (workers.count() != 4 || !EachIndexOnce(workers)) return false;
    return test::TrueInChild([&] {
      setenv("TILEGRAD_TEST_THREADS", std::to_string(granted).c_str(), 1);
      // One that has ended makes room for the next.
      const bool all_refused = granted == 0, none_refused = granted >= 3;
      return EachIndexOnce(workers) && (!all_refused || Noticed(0, 4)) &&
             (!none_refused || Noticed(3, 4));
    });
  });
}

INSTANTIATE_TEST_SUITE_P(Granted, FewThreads, testing::Values(0, 1, 2, 3, 4, 7));

}  // namespace tilegrad::few_threads_test
