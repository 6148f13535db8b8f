// SPDX-License-Identifier: Apache-2.0
#include "base/parallel.h"

#include <sched.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include <chrono>
#include <exception>
#include <thread>
#include <utility>
#include <vector>

#include "base/loop_team.h"
#include "base/loop_trace.h"
#include "base/sanitizers.h"

namespace tilegrad {
namespace {

// How many more threads the system grants now, at most `wanted`: starts them, and ends them.
int GrantedThreads(int wanted) {
  std::atomic<bool> all_there = false;
  std::vector<std::thread> threads;
  try {
    threads.reserve(static_cast<std::size_t>(wanted));
    for (int i = 0; i < wanted; ++i) threads.emplace_back([&] { all_there.wait(false); });
  } catch (...) {  // no more are granted
  }
  all_there = true;
  all_there.notify_all();
  for (std::thread& thread : threads) thread.join();
  return static_cast<int>(threads.size());
}

// The threads of oneTBB, which ends the process if the system refuses it a thread. So this tests
// beforehand whether the threads are available, and starts at once those that the existing workers
// may request; they stay. If the system is short of threads, limits oneTBB to these.
class TbbThreads {
 public:
  // For another Workers with `count` >= 1: returns how many it may have, 1..count.
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
  // For the end of a Workers whose Add returned `count`.
  void Remove(int count) {
    const std::lock_guard lock(mutex_);
    wanted_ -= count - 1;
  }

 private:
  // Tests whether `most` threads are available, and spare ones for other processes; else how many
  // of the needed ones.
  void Try(int most, int needed) {
    constexpr int kSpare = 8;   // others in the process may start some before oneTBB does
    if (plenty_) Start(most_);  // no loop may be starting one meanwhile
    const int missing = most + kSpare - started_;
    const int granted = GrantedThreads(missing);
    plenty_ = granted == missing;
    Limit(plenty_ ? most : std::max(started_, std::min(needed, started_ + granted)));
  }

  // Must allow more than there are cores (tests of determinism use more), or oneTBB prints a
  // warning. Of several limits oneTBB takes the least, so there is one for all workers, which is
  // never destroyed, since oneTBB may be gone by then.
  void Limit(int threads) {
    if (threads == allowed_) return;
    const auto* const before = limit_;
    limit_ = new tbb::global_control(tbb::global_control::max_allowed_parallelism,
                                     static_cast<std::size_t>(threads) + 1);
    delete before;
    allowed_ = threads;
  }

  // Runs a loop until `threads` of them are in it, or for a second: loops of other workers may hold
  // some. The arena is never destroyed, since it keeps the threads, but stays reachable, so that it
  // is no leak.
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
  // Not counting the callers' threads: oneTBB's limit, ours, and the sum over all workers.
  int allowed_ = AvailableCores() - 1, most_ = allowed_, wanted_ = 0;
  int started_ = 0;
};

TbbThreads& Threads() {
  static TbbThreads* const threads = new TbbThreads;
  return *threads;
}

// The process that uses oneTBB, 0 before any does. A forked child inherits oneTBB's bookkeeping,
// but not its threads, and possibly locks that those held: it must not touch oneTBB.
std::atomic<pid_t> tbb_process{0};

bool ThisProcessOwnsTbb() {
  // oneTBB is not built with ThreadSanitizer, which therefore cannot see its synchronisation.
  if constexpr (kThreadSanitizer) return false;
  const pid_t mine = getpid();
  pid_t owner = 0;
  return tbb_process.compare_exchange_strong(owner, mine) || owner == mine;
}

// Whether the system has refused threads; reported once.
enum class Refusal { kNone, kFresh, kTold };
std::atomic<Refusal> refusal{Refusal::kNone};

void NoteRefusal() {
  Refusal none = Refusal::kNone;
  refusal.compare_exchange_strong(none, Refusal::kFresh);
}

// The fallback loop, in which the calling thread takes part.
struct OwnLoop {
  const Workers* workers = nullptr;
  std::size_t worker = 0;
};
thread_local OwnLoop own_loop;

// Replaces oneTBB by threads that live for one loop. `one_loop`: the workers' mutex, for loops
// started by several threads of the caller.
void ForOnOwnThreads(const Workers* workers, std::mutex* one_loop, std::size_t n,
                     FunctionRef<void(std::size_t, std::size_t)> task) {
  if (own_loop.workers == workers) {  // nested: runs on the thread that reaches it
    for (std::size_t i = 0; i < n; ++i) task(i, own_loop.worker);
    return;
  }
  const std::lock_guard lock(*one_loop);
  std::atomic<std::size_t> next = 0;
  std::once_flag failed;
  std::exception_ptr error;  // the first (out of memory): rethrown to the caller, as oneTBB does
  const auto work = [&](std::size_t worker) {
    ReserveThreadData();
    const OwnLoop outer = std::exchange(own_loop, {workers, worker});
    try {
      for (std::size_t i = next++; i < n; i = next++) task(i, worker);
    } catch (...) {
      std::call_once(failed, [&] { error = std::current_exception(); });
      next = n;
    }
    own_loop = outer;
  };
  std::vector<std::thread> threads;
  const std::size_t count = std::min(n, workers->size());
  try {
    threads.reserve(count);
    for (std::size_t w = 1; w < count; ++w) threads.emplace_back(work, w);
  } catch (...) {
    NoteRefusal();  // the existing threads do the work
  }
  work(0);
  for (std::thread& thread : threads) thread.join();
  if (error != nullptr) std::rethrow_exception(error);
}

thread_local volatile int t_exceptions = 0;  // volatile: a compiler removes unread variables

}  // namespace

int AvailableCores() {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  return sched_getaffinity(0, sizeof(cores), &cores) == 0 ? std::max(1, CPU_COUNT(&cores)) : 1;
}

Workers::Workers(int count) : count_(count > 0 ? count : AvailableCores()) {
  if (count_ == 1 || !ThisProcessOwnsTbb()) return;
  const int granted = Threads().Add(count_);
  if (granted < count_) NoteRefusal();
  count_ = granted;
  if (count_ > 1) team_ = LoopTeam::Make(count_);
}

Workers::Workers(int count, LoopTrace* trace) : count_(count), trace_(trace) {}

Workers::~Workers() {
  if (team_ == nullptr) return;
  if (ThisProcessOwnsTbb()) {
    team_->Dismiss();
    Threads().Remove(count_);
  } else {  // never destroyed, since it would touch oneTBB
    static_cast<void>(new std::shared_ptr<LoopTeam>(std::move(team_)));
  }
}

const char* TakeThreadNotice() {
  Refusal fresh = Refusal::kFresh;
  return refusal.load(std::memory_order_relaxed) == fresh &&
                 refusal.compare_exchange_strong(fresh, Refusal::kTold)
             ? "the system allows fewer threads than requested; continuing with fewer"
             : nullptr;
}

LoopTeam* Workers::Team() const { return ThisProcessOwnsTbb() ? team_.get() : nullptr; }

bool Workers::Offer(std::size_t times, const std::function<void()>& help) const {
  LoopTeam* const team = Team();
  if (team != nullptr) team->Offer(times, help);
  return team != nullptr;
}

void Workers::Dismiss() const {
  if (LoopTeam* const team = Team(); team != nullptr) team->Dismiss();
}

void Workers::For(std::size_t n, FunctionRef<void(std::size_t, std::size_t)> task,
                  LoopSite site) const {
  if (trace_ != nullptr) {
    trace_->Run(n, task, site);
  } else if (count_ == 1) {
    for (std::size_t i = 0; i < n; ++i) task(i, 0);
  } else if (LoopTeam* const team = Team(); team != nullptr) {
    team->For(n, task);
  } else {
    ForOnOwnThreads(this, &own_loop_, n, task);
  }
}

void Workers::Part::For(std::size_t n, FunctionRef<void(std::size_t, std::size_t)> task,
                        LoopSite site) const {
  if (parts_ == 1 || workers_.trace_ != nullptr ||
      (waiting_.load(std::memory_order_relaxed) == 0 && workers_.Team() != nullptr)) {
    workers_.For(n, task, site);
  } else {
    for (std::size_t i = 0; i < n; ++i) task(i, worker_);
  }
}

void Workers::ForParts(std::size_t n, FunctionRef<void(std::size_t, const Part&)> task,
                       LoopSite site) const {
  std::atomic<std::size_t> waiting{n};
  const auto run = [&](std::size_t index, std::size_t worker) {
    waiting.fetch_sub(1, std::memory_order_relaxed);
    task(index, Part(*this, worker, n, waiting));
  };
  For(n, run, site);
}

void Workers::ForRanges(std::size_t n, std::size_t grain,
                        FunctionRef<void(std::size_t, std::size_t, std::size_t)> task,
                        LoopSite site) const {
  grain = std::max<std::size_t>(grain, 1);
  const auto run = [&](std::size_t i, std::size_t worker) {
    task(i * grain, std::min(n, (i + 1) * grain), worker);
  };
  For((n + grain - 1) / grain, run, site);
}

void Workers::NoteTraffic(double bytes) const {
  if (trace_ != nullptr) trace_->NoteTraffic(bytes);
}

static_assert(kMostCores == CPU_SETSIZE);

int MachineCores() { return static_cast<int>(sysconf(_SC_NPROCESSORS_ONLN)); }

void KeepToCores(std::span<const int> cores) {
  cpu_set_t set;
  CPU_ZERO(&set);
  for (const int core : cores) {
    if (core >= 0 && core < kMostCores) CPU_SET(core, &set);
  }
  if (CPU_COUNT(&set) > 0) sched_setaffinity(0, sizeof(set), &set);
}

void ReserveThreadData() { t_exceptions = std::uncaught_exceptions(); }

}  // namespace tilegrad
