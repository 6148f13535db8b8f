// SPDX-License-Identifier: Apache-2.0
#include "base/tbb_threads.h"

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <thread>
#include <vector>

#include "base/parallel.h"
#include "base/thread_data.h"

namespace tilegrad {
namespace {

// How many more threads the system grants now, at most `wanted`: they are started, and end.
int GrantedThreads(int wanted) {
  std::atomic<bool> all_there = false;
  std::vector<std::thread> threads;
  try {
    threads.reserve(static_cast<std::size_t>(wanted));
    for (int i = 0; i < wanted; ++i) threads.emplace_back([&] { all_there.wait(false); });
  } catch (...) {  // that many it is
  }
  all_there = true;
  all_there.notify_all();
  for (std::thread& thread : threads) thread.join();
  return static_cast<int>(threads.size());
}

// The threads of oneTBB, which ends the process where the system refuses it one. So they are tried
// before any loop needs them, and those that the existing workers may ask for are started at once;
// they stay. Where the system has not plenty, oneTBB may start no more than these.
class TbbThreads {
 public:
  int Add(int count) {
    const std::lock_guard lock(mutex_);
    wanted_ += count - 1;
    const int most = std::max(most_, count - 1);
    const int needed = std::min(wanted_, most);
    if (!plenty_ || most > most_) Try(most, needed);
    most_ = most;
    const int threads = plenty_ ? needed : std::min(needed, allowed_);
    if (threads > started_) Start(threads);
    const int fewer = std::max(0, count - 1 - started_);
    wanted_ -= fewer;
    return count - fewer;
  }
  void Remove(int count) {
    const std::lock_guard lock(mutex_);
    wanted_ -= count - 1;
  }

 private:
  // Whether there are `most`, and some to spare for whoever comes between; else how many there are
  // of those needed.
  void Try(int most, int needed) {
    constexpr int kSpare = 8;   // others in the process may start some before oneTBB does
    if (plenty_) Start(most_);  // no loop may be starting one meanwhile
    const int missing = most + kSpare - started_;
    const int granted = GrantedThreads(missing);
    plenty_ = granted == missing;
    Limit(plenty_ ? most : std::max(started_, std::min(needed, started_ + granted)));
  }

  // More than there are cores (tests of determinism do that) must be allowed, or oneTBB prints a
  // warning. Of several limits it takes the least, so there is one for all workers, which is never
  // destroyed: oneTBB may be gone by then.
  void Limit(int threads) {
    if (threads == allowed_) return;
    const auto* const before = limit_;
    limit_ = new tbb::global_control(tbb::global_control::max_allowed_parallelism,
                                     static_cast<std::size_t>(threads) + 1);
    delete before;
    allowed_ = threads;
  }

  // Until `threads` of them are in one loop, or for a second: loops of other workers may keep some.
  // The arena is never destroyed: it keeps the threads. Nor is it forgotten, or it were a leak.
  void Start(int threads) {
    auto* const arena = arenas_.emplace_back(new tbb::task_arena(threads + 1));
    std::atomic<int> waiting = threads + 1;
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(1);
    arena->execute([&] {
      const auto wait = [&](int) {
        ReserveThreadData();
        for (--waiting; waiting > 0 && std::chrono::steady_clock::now() < end;) {
          std::this_thread::yield();
        }
      };
      tbb::parallel_for(0, threads + 1, wait, tbb::simple_partitioner());
    });
    started_ = threads;
  }

  std::mutex mutex_;
  std::vector<tbb::task_arena*> arenas_;
  tbb::global_control* limit_ = nullptr;
  bool plenty_ = false;
  // Beyond the threads of callers: oneTBB's limit and ours, what all workers ask for.
  int allowed_ = AvailableCores() - 1, most_ = allowed_, wanted_ = 0;
  int started_ = 0;
};

TbbThreads& Threads() {
  static TbbThreads* const threads = new TbbThreads;
  return *threads;
}

}  // namespace

int AddTbbThreads(int count) { return Threads().Add(count); }
void RemoveTbbThreads(int count) { Threads().Remove(count); }

}  // namespace tilegrad
