// SPDX-License-Identifier: Apache-2.0
// A function in a child process: its result arrives, and nothing that it does harms the
// parent.
#include "io/guarded_process.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <thread>

#include "base/parallel.h"
#include "base/read_budget.h"
#include "base/sanitizers.h"
#include "support/forked.h"
#include "support/temp_folder.h"

namespace tilegrad::io::guarded_process_test {

const auto kNoAnswer = [](std::string_view) { return std::optional<Bytes>(); };

Result<Bytes> Guarded(ChildFunction run, const GuardLimits& limits = {}) {
  return RunGuarded(run, kNoAnswer, limits);
}

std::ptrdiff_t OpenDescriptors() {
  return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {});
}

// After each test no child is left, dead or alive, and no descriptor.
class GuardedProcessTest : public testing::Test {
 protected:
  ~GuardedProcessTest() override {
    EXPECT_EQ(::waitpid(-1, nullptr, WNOHANG), -1);
    EXPECT_EQ(OpenDescriptors(), descriptors_);
  }
  const std::ptrdiff_t descriptors_ = OpenDescriptors();
};

TEST_F(GuardedProcessTest, BytesOfAnySizeArrive) {
  for (const std::size_t size : {std::size_t{0}, std::size_t{1}, std::size_t{50} << 20}) {
    const auto got = Ok(Guarded([&](AskParent) { return Bytes(size, 7); }));
    EXPECT_EQ(*got, Bytes(size, 7));
  }
}

TEST_F(GuardedProcessTest, QuestionsAreAnsweredByTheParent) {
  int asked = 0;
  const auto got = Ok(RunGuarded(
      [](AskParent ask) {
        const auto large = ask("large"), none = ask("none");
        if (none || ask("") || ask(std::string(5000, 'x'))) std::abort();
        return large.value();
      },
      [&](std::string_view question) {
        ++asked;
        return question == "large" ? std::optional(Bytes(3'000'000, 9)) : std::nullopt;
      },
      {}));
  EXPECT_EQ(*got, Bytes(3'000'000, 9));
  EXPECT_EQ(asked, 2);
}

TEST_F(GuardedProcessTest, CrashesAreErrors) {
  ExpectMessage(Guarded([](AskParent) -> Bytes { std::abort(); }).status(), "crashed", "Abort");
  ExpectMessage(Guarded([](AskParent) -> Bytes {
                  ::raise(SIGSEGV);
                  return {};
                }).status(),
                "crashed", "Segmentation");
  ExpectMessage(Guarded([](AskParent) -> Bytes { throw std::runtime_error("x"); }).status(),
                "exception");
  ExpectMessage(Guarded([](AskParent) -> Bytes { ::_exit(3); }).status(), "code 3");
  ExpectMessage(Guarded([](AskParent) -> Bytes { ::_exit(0); }).status(), "an incomplete result");
}

TEST_F(GuardedProcessTest, WhatLoopsIsStoppedByProcessorTime) {
  GuardLimits limits;
  limits.cpu_seconds = 1;
  const auto got = Guarded(
      [](AskParent) -> Bytes {
        for (std::atomic<int> i = 0;; ++i) {
        }
      },
      limits);
  ExpectMessage(got.status(), "more than 1 s of processor time");
}

TEST_F(GuardedProcessTest, WhatWaitsIsStoppedByTheClock) {
  GuardLimits limits;
  limits.wall_seconds = 0.2;
  const auto sleep = [](AskParent) -> Bytes {
    for (;;) ::pause();
  };
  ExpectMessage(Guarded(sleep, limits).status(), "more than 0.2 s");
  const auto deaf = [](AskParent) -> Bytes {  // closes its end of everything, ignores what it can
    for (int fd = 3; fd < 100; ++fd) ::close(fd);
    for (int signal = 1; signal < NSIG; ++signal) std::signal(signal, SIG_IGN);
    for (;;) ::pause();
  };
  ExpectMessage(Guarded(deaf, limits).status(), "more than 0.2 s");
}

TEST_F(GuardedProcessTest, MemoryHasALimit) {
  if (kSanitizer) GTEST_SKIP() << "sanitizers reserve terabytes";
  GuardLimits limits;
  limits.memory_bytes = std::size_t{200} << 20;
  const auto of_size = [&](std::size_t mebibytes) {
    return Guarded([&](AskParent) { return Bytes(Bytes(mebibytes << 20, 1).size() / 1000, 1); },
                   limits);
  };
  EXPECT_TRUE(of_size(100).ok());
  const Status status = of_size(300).status();
  EXPECT_EQ(status.code(), StatusCode::kResourceExhausted);
  ExpectMessage(status, "more than 200 MB of memory");
}

TEST_F(GuardedProcessTest, StopsWhenItIsTold) {
  StopFlag stop = false;
  StopGuardedBy(&stop);
  const auto sleep = [](AskParent) -> Bytes {
    for (;;) ::pause();
  };
  const auto start = std::chrono::steady_clock::now();
  std::thread teller([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    stop = true;
  });
  EXPECT_EQ(Guarded(sleep).status().code(), StatusCode::kCancelled);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  EXPECT_LT(seconds.count(), 10);  // 0.15 s on a machine that is not busy; 120 s without the flag
  teller.join();
  EXPECT_EQ(Guarded(sleep).status().code(), StatusCode::kCancelled);
  StopGuardedBy(nullptr);
  EXPECT_TRUE(Guarded([](AskParent) { return Bytes(1, 5); }).ok());
}

// None of these says anything of what the child read.
TEST_F(GuardedProcessTest, WhatTheSystemRefusesIsNoFault) {
  const auto refused = [](auto resource, rlim_t limit, ChildFunction run, const char* says) {
    return test::TrueInChild([&] {
      const rlimit now{limit, limit};
      if (::setrlimit(resource, &now) != 0) return false;
      const ShortageWatch watch;
      const Status status = Guarded(run).status();
      return status.code() == StatusCode::kIo && !watch.Check("x").ok() &&
             status.message().find(says) != std::string::npos;
    });
  };
  const auto nothing = [](AskParent) { return Bytes(); };
  EXPECT_TRUE(refused(RLIMIT_NOFILE, 3, nothing, "memory file"));
  EXPECT_TRUE(refused(RLIMIT_NOFILE, 5, nothing, "socket"));
  const volatile std::size_t gigabyte = std::size_t{1} << 30;  // clang leaves out what it can count
  const auto large = [&](AskParent) { return Bytes(Bytes(gigabyte, 1).size() >> 20, 1); };
  if (!kSanitizer) {
    EXPECT_TRUE(refused(RLIMIT_AS, std::size_t{900} << 20, large, "ulimit -v"));
  }
  const ShortageWatch watch;
  const Status killed = Guarded([](AskParent) -> Bytes {
                          ::raise(SIGKILL);
                          return {};
                        }).status();
  EXPECT_EQ(killed.code(), StatusCode::kIo);
  ExpectMessage(watch.Check("a.stl"), "a.stl", "memory");
}

// Of `ulimit -f 1`: the memory is there.
TEST_F(GuardedProcessTest, ALimitOfFilesIsNotCalledOneOfMemory) {
  EXPECT_TRUE(test::TrueInChild([] {
    const rlimit limit{1024, 1024};
    if (::setrlimit(RLIMIT_FSIZE, &limit) != 0) return false;
    const Status status = Guarded([](AskParent) { return Bytes(5000, 1); }).status();
    return status.code() == StatusCode::kIo &&
           status.message() ==
               "could not return its result: files are limited to 1024 bytes here (ulimit -f)";
  }));
}

TEST_F(GuardedProcessTest, ResultsHaveALimit) {
  GuardLimits limits;
  limits.memory_bytes = std::size_t{100} << 20;
  static const Bytes large(std::size_t{101} << 20, 1);  // the parent's: allocates nothing here
  const auto got = RunGuarded(
      [](AskParent ask) {
        (void)ask("x");
        return Bytes(1, 1);
      },
      [](std::string_view) { return std::optional<Bytes>(large); }, limits);
  ASSERT_TRUE(got.ok()) << got.status().message();  // an answer that is too large is none
  limits.memory_bytes = std::size_t{1} << 20;
  ExpectMessage(Guarded([](AskParent) { return Bytes(2 << 20, 1); }, limits).status(),
                "more than 1 MB of memory");
}

TEST_F(GuardedProcessTest, EndlessQuestionsAreCutOff) {
  const auto got = RunGuarded(
      [](AskParent ask) -> Bytes {
        for (;;) (void)ask("more");
      },
      [](std::string_view) { return std::optional(Bytes(10)); }, {});
  ExpectMessage(got.status(), "asked more than");
}

std::atomic<int> handled = 0;

// Neither handlers nor the terminal's signals, which go to the group, reach the child.
TEST_F(GuardedProcessTest, SignalHandlersStayInTheParent) {
  const auto before = std::signal(SIGTERM, [](int) { ++handled; });
  const auto got = Guarded([](AskParent) -> Bytes {
    ::raise(SIGTERM);
    return {};
  });
  ExpectMessage(got.status(), "crashed", "Terminated");
  const auto group = Ok(Guarded([](AskParent) { return Bytes(1, ::getpgrp() == ::getpid()); }));
  EXPECT_EQ((*group)[0], 1);
  std::raise(SIGTERM);
  EXPECT_EQ(handled, 1);
  std::signal(SIGTERM, before);
}

TEST_F(GuardedProcessTest, WorksWhereChildrenAreReapedBySomebodyElse) {
  const auto before = std::signal(SIGCHLD, SIG_IGN);
  const auto good = Guarded([](AskParent) { return Bytes(1, 5); });
  const auto bad = Guarded([](AskParent) -> Bytes { std::abort(); });
  std::signal(SIGCHLD, before);
  ASSERT_TRUE(good.ok()) << good.status().message();
  EXPECT_EQ(*good, Bytes(1, 5));
  ExpectMessage(bad.status(), "an incomplete result");
}

TEST_F(GuardedProcessTest, NothingIsPrintedTwice) {
  testing::internal::CaptureStdout();
  std::printf("once ");
  const auto got = Guarded([](AskParent) {
    std::printf("never ");
    std::fflush(stdout);
    return Bytes();
  });
  std::printf("end");
  std::fflush(stdout);
  ExpectNotIn(testing::internal::GetCapturedStdout(), "never");
  EXPECT_TRUE(got.ok());
}

TEST_F(GuardedProcessTest, DescriptorsOfTheParentAreClosed) {
  const auto got =
      Ok(Guarded([](AskParent) { return Bytes(static_cast<std::size_t>(OpenDescriptors()), 0); }));
  EXPECT_LE(got->size(), 7u);  // three streams, socket, memory file, those of the listing itself
}

// While other threads allocate and fork: no lock is left held in a child.
TEST_F(GuardedProcessTest, ManyThreadsAtOnce) {
  if (kAddressSanitizer) GTEST_SKIP() << "its allocator may be locked at a fork";
  std::atomic<int> good = 0;
  const Workers workers(7);
  workers.For(200, [&](std::size_t i, std::size_t) {
    std::vector<std::string> garbage(100, std::string(i + 100, 'x'));
    const auto got = Guarded([&](AskParent) {
      std::vector<std::string> more(100, std::string(i + 100, 'y'));
      return Bytes(i + more.size(), 3);
    });
    good += got.ok() && *got == Bytes(i + 100, 3);
  });
  EXPECT_EQ(good, 200);
}

}  // namespace tilegrad::io::guarded_process_test
