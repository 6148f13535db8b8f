// SPDX-License-Identifier: Apache-2.0
// Threads are an argument: every computation receives a Workers. With side_loop.h the home of
// oneTBB.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <memory>
#include <mutex>
#include <span>

#include "base/function_ref.h"

namespace tilegrad {

class LoopTrace;
class SideLoop;

// Where a loop stands in the source: its name in a LoopTrace.
struct LoopSite {
  const char* file;
  int line;
  // As a default argument: of the caller.
  static constexpr LoopSite Here(const char* file = __builtin_FILE(), int line = __builtin_LINE()) {
    return {file, line};
  }
};

// A fixed number of workers. Copies nothing; two Workers are independent. Where the system refuses
// threads (limits of a container) there are fewer than asked for, the caller's own at the least.
//
// They survive a fork: a child of a process that used oneTBB lacks its threads, so loops there
// start their own, at some 20 microseconds per thread and loop. Workers that are in the middle of a
// loop when another thread forks are unusable in the child.
class Workers {
 public:
  // count 0: one per core that this process may use.
  explicit Workers(int count = 0);
  // Stands for `count` workers, 1 or more, and is none: the calling thread runs every loop itself,
  // cut as for that many, and `trace`, which outlives this, records it.
  Workers(int count, LoopTrace* trace);
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  int count() const { return count_; }

  // Calls task(index, worker) once for each index in [0, n) and returns when all are done; worker
  // is in [0, count()) and no two calls with the same worker overlap, so it selects scratch memory.
  // Which worker takes which index is not determined: results must depend on the index only, which
  // is how the library keeps the same bits for any thread count. What a task throws (it may run out
  // of memory) comes out here when the others have ended, some of which may not have begun. Calls
  // may nest, but not those of A within those of B within those of A, which may wait for ever.
  void For(std::size_t n, FunctionRef<void(std::size_t index, std::size_t worker)> task,
           LoopSite site = LoopSite::Here()) const;

  // The same over fixed ranges [begin, end) of at most `grain` indices; the split depends on n and
  // grain only.
  void ForRanges(std::size_t n, std::size_t grain,
                 FunctionRef<void(std::size_t begin, std::size_t end, std::size_t worker)> task,
                 LoopSite site = LoopSite::Here()) const;

  // Bytes that the next loop reads and writes in memory, for a trace.
  void NoteTraffic(double bytes) const;

  // A task of ForParts.
  class Part {
   public:
    std::size_t worker() const { return worker_; }

    // As Workers::For, within the task; but `task` must not contain loops.
    void For(std::size_t n, FunctionRef<void(std::size_t index, std::size_t worker)> task,
             LoopSite site = LoopSite::Here()) const;

   private:
    friend class Workers;
    const Workers& workers_;
    std::size_t worker_, parts_;
    const std::atomic<std::size_t>& waiting_;  // parts that no worker has taken

    Part(const Workers& workers, std::size_t worker, std::size_t parts,
         const std::atomic<std::size_t>& waiting)
        : workers_(workers), worker_(worker), parts_(parts), waiting_(waiting) {}
  };

  // For few, long tasks, whose last ones would leave workers idle. While tasks are waiting, a
  // worker runs the loops (Part::For) of its task alone; after that, idle workers join in. A worker
  // that waits for the end of such a loop may run iterations of other tasks' loops. So data that
  // one loop leaves for the next must lie in memory of the task, not in scratch by worker index
  // that such iterations write.
  void ForParts(std::size_t n, FunctionRef<void(std::size_t index, const Part& part)> task,
                LoopSite site = LoopSite::Here()) const;

 private:
  friend class SideLoop;
  struct Impl;
  bool HasArena() const;  // of oneTBB, which this process may use

  int count_;
  LoopTrace* trace_ = nullptr;
  std::unique_ptr<Impl> impl_;  // null where oneTBB is not used
  mutable std::mutex own_loop_;
};

// A sentence for people, once after the system has refused a thread; null otherwise.
const char* TakeThreadNotice();

// The cores this process may run on (its affinity mask), at least 1.
int AvailableCores();

inline constexpr int kMostCores = 1024;  // numbers are below

// How many the machine has switched on, whether or not this process may use them.
int MachineCores();

// Keeps the calling thread, and those it starts, to these cores. Where the system refuses, it stays
// where it may run: only speed is at stake. Numbers out of range are left out.
void KeepToCores(std::span<const int> cores);

// For a thread that has just started. Of libraries that are loaded at run time, as Python loads
// ours, glibc allocates a thread's own variables at their first use, and ends the process where it
// cannot. Those of C++'s runtime are first used by the thread's first exception: mostly
// std::bad_alloc.
void ReserveThreadData();

// Calls task(begin, end) for ranges of at most `size` indices that make up [0, n); on the calling
// thread, in order, where `workers` is null or there is one range only.
template <class Task>
void ForChunks(const Workers* workers, std::size_t n, std::size_t size, const Task& task,
               LoopSite site = LoopSite::Here()) {
  if (workers == nullptr || n <= size) {
    for (std::size_t i = 0; i < n; i += size) task(i, std::min(n, i + size));
    return;
  }
  workers->ForRanges(
      n, size, [&](std::size_t begin, std::size_t end, std::size_t) { task(begin, end); }, site);
}

}  // namespace tilegrad
