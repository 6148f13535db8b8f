// SPDX-License-Identifier: Apache-2.0
// Threads are an argument: every computation receives a Workers. Home of oneTBB, with loop_team.h.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <span>

#include "base/function_ref.h"

namespace tilegrad {

class LoopTeam;
class LoopTrace;
class SideLoop;
class WorkerGroups;

// The source location of a loop: its name in a LoopTrace.
struct LoopSite {
  const char* file;
  int line;
  // As a default argument: the location of the caller.
  static constexpr LoopSite Here(const char* file = __builtin_FILE(), int line = __builtin_LINE()) {
    return {file, line};
  }
};

// A fixed number of workers. Two Workers are independent. Where the system refuses threads
// (container limits) there are fewer than requested, at least the caller's own.
//
// They survive a fork: a child of a process that used oneTBB lacks its threads, so loops there
// start their own, at some 20 microseconds per thread and loop. Workers inside a loop while another
// thread forks are unusable in the child.
class Workers {
 public:
  // count 0: one per core that this process may use.
  explicit Workers(int count = 0);
  // Simulates `count` >= 1 workers: the calling thread runs every loop itself, split as for that
  // many, and `trace`, which must outlive this, records it.
  Workers(int count, LoopTrace* trace);
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  int count() const { return count_; }
  // The same as a size: of what every worker has one of.
  std::size_t size() const { return static_cast<std::size_t>(count_); }

  // Calls task(index, worker) once for each index in [0, n) and returns when all are done; worker
  // is in [0, count()) and no two calls with the same worker overlap, so it selects scratch memory.
  // A task that needs none is task(index), here and below.
  // Which worker takes which index is not determined: results must depend on the index only, which
  // is how the library keeps the same bits for any thread count. Rethrows what a task throws (such
  // as out of memory) once all running tasks have ended; some may never start. Calls may nest, but
  // a cycle (loops of A inside loops of B inside loops of A) may deadlock.
  void For(std::size_t n, FunctionRef<void(std::size_t index, std::size_t worker)> task,
           LoopSite site = LoopSite::Here()) const;

  // The same over fixed ranges [begin, end) of at most `grain` indices; the split depends on n and
  // grain only.
  void ForRanges(std::size_t n, std::size_t grain,
                 FunctionRef<void(std::size_t begin, std::size_t end, std::size_t worker)> task,
                 LoopSite site = LoopSite::Here()) const;

  // task(index) for each index in [0, n), `grain` of them at a time: for short tasks.
  template <class Task>
  void ForEach(std::size_t n, std::size_t grain, const Task& task,
               LoopSite site = LoopSite::Here()) const {
    const auto range = [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) task(i);
    };
    ForRanges(n, grain, range, site);
  }

  // Bytes of memory that the next loop reads and writes, for a trace.
  void NoteTraffic(double bytes) const;

  // A task of ForParts.
  class Part {
   public:
    std::size_t worker() const { return worker_; }

    // Like Workers::For, inside the task; but `task` must not contain loops.
    void For(std::size_t n, FunctionRef<void(std::size_t index, std::size_t worker)> task,
             LoopSite site = LoopSite::Here()) const;

   private:
    friend class Workers;
    const Workers& workers_;
    std::size_t worker_, parts_;
    const std::atomic<std::size_t>& waiting_;  // parts that no worker has taken yet

    Part(const Workers& workers, std::size_t worker, std::size_t parts,
         const std::atomic<std::size_t>& waiting)
        : workers_(workers), worker_(worker), parts_(parts), waiting_(waiting) {}
  };

  // For few, long tasks, the last of which would leave workers idle. While tasks are waiting, a
  // worker runs the loops (Part::For) of its task alone; after that, idle workers join in.
  void ForParts(std::size_t n, FunctionRef<void(std::size_t index, const Part& part)> task,
                LoopSite site = LoopSite::Here()) const;

 private:
  friend class SideLoop;
  friend class WorkerGroups;
  LoopTeam* Team() const;  // null where oneTBB is not used, or not by this process
  // LoopTeam::Offer; false without a team.
  bool Offer(std::size_t times, const std::function<void()>& help) const;
  void Dismiss() const;  // LoopTeam::Dismiss

  int count_;
  LoopTrace* trace_ = nullptr;
  std::shared_ptr<LoopTeam> team_;  // null if oneTBB is not used
  mutable std::mutex own_loop_;
};

// A message for the user, once after the system has refused a thread; null otherwise.
const char* TakeThreadNotice();

// The cores this process may run on (its affinity mask), at least 1.
int AvailableCores();

inline constexpr int kMostCores = 1024;  // bound on core numbers

// The machine's online cores, whether or not this process may use them.
int MachineCores();

// Pins the calling thread, and those it starts, to these cores. Where the system refuses, the
// affinity stays as it is: only speed is at stake. Ignores numbers out of range.
void KeepToCores(std::span<const int> cores);

// Call at the start of a thread. In libraries loaded at run time, as Python loads ours, glibc
// allocates thread-local variables at their first use, and ends the process if it cannot. The C++
// runtime's are first used by the thread's first exception: mostly std::bad_alloc.
void ReserveThreadData();

// Calls task(begin, end) for ranges of at most `size` indices that cover [0, n); on the calling
// thread, in order, if `workers` is null or there is only one range.
template <class Task>
void ForChunks(const Workers* workers, std::size_t n, std::size_t size, const Task& task,
               LoopSite site = LoopSite::Here()) {
  if (workers == nullptr || n <= size) {
    for (std::size_t i = 0; i < n; i += size) task(i, std::min(n, i + size));
    return;
  }
  workers->ForRanges(n, size, task, site);
}

}  // namespace tilegrad
