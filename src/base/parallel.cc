// SPDX-License-Identifier: Apache-2.0
#include "base/parallel.h"

#include <sched.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <tbb/task_scheduler_observer.h>

#include <algorithm>
#include <optional>

namespace tilegrad {
namespace {

cpu_set_t CoresOfThread() {
  cpu_set_t set;
  CPU_ZERO(&set);
  if (sched_getaffinity(0, sizeof(set), &set) != 0) CPU_ZERO(&set);
  return set;
}

// The set that holds only core number `index` (modulo their count) of `cores`; empty if they are.
cpu_set_t OnlyCore(const cpu_set_t& cores, int index) {
  cpu_set_t only;
  CPU_ZERO(&only);
  const int count = CPU_COUNT(&cores);
  for (int core = 0, seen = 0; count > 0 && core < CPU_SETSIZE; ++core) {
    if (CPU_ISSET(core, &cores) && seen++ == index % count) CPU_SET(core, &only);
  }
  return only;
}

// Binds every thread that enters the arena, the caller's too, to a core of its own, and gives it
// all cores of the process back when it leaves.
class PinningObserver : public tbb::task_scheduler_observer {
 public:
  explicit PinningObserver(tbb::task_arena& arena) : task_scheduler_observer(arena) {
    observe(true);
  }
  ~PinningObserver() override { observe(false); }
  PinningObserver(const PinningObserver&) = delete;
  PinningObserver& operator=(const PinningObserver&) = delete;
  void on_scheduler_entry(bool) override {
    Bind(OnlyCore(cores_, tbb::this_task_arena::current_thread_index()));
  }
  void on_scheduler_exit(bool) override { Bind(cores_); }

 private:
  // Where the system refuses, the thread stays where it may run: only speed is at stake.
  static void Bind(const cpu_set_t& cores) {
    if (CPU_COUNT(&cores) > 0) sched_setaffinity(0, sizeof(cores), &cores);
  }
  const cpu_set_t cores_ = CoresOfThread();
};

}  // namespace

struct Workers::Impl {
  Impl(int count, Pinning pinning) : arena(count) {
    if (pinning == Pinning::kOn) observer.emplace(arena);
    // More workers than cores (tests of determinism do that) must be allowed, or oneTBB prints a
    // warning.
    if (count > AvailableCores())
      limit.emplace(tbb::global_control::max_allowed_parallelism, count);
  }
  std::optional<tbb::global_control> limit;
  tbb::task_arena arena;
  std::optional<PinningObserver> observer;
};

int AvailableCores() {
  const cpu_set_t cores = CoresOfThread();
  return std::max(1, CPU_COUNT(&cores));
}

Workers::Workers(int count, Pinning pinning)
    : count_(count > 0 ? count : AvailableCores()),
      impl_(std::make_unique<Impl>(count_, pinning)) {}

Workers::~Workers() = default;

void Workers::For(std::size_t n, FunctionRef<void(std::size_t, std::size_t)> task) const {
  if (count_ == 1 || n <= 1) {
    for (std::size_t i = 0; i < n; ++i) task(i, 0);
    return;
  }
  impl_->arena.execute([&] {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, n, 1),
        [&](const tbb::blocked_range<std::size_t>& range) {
          const auto worker =
              static_cast<std::size_t>(tbb::this_task_arena::current_thread_index());
          // Isolated: while a nested For waits it may only take its own work, so a worker's scratch
          // is never entered twice.
          for (std::size_t i = range.begin(); i != range.end(); ++i) {
            tbb::this_task_arena::isolate([&] { task(i, worker); });
          }
        },
        tbb::simple_partitioner());
  });
}

void Workers::ForRanges(std::size_t n, std::size_t grain,
                        FunctionRef<void(std::size_t, std::size_t, std::size_t)> task) const {
  grain = std::max<std::size_t>(grain, 1);
  For((n + grain - 1) / grain, [&](std::size_t i, std::size_t worker) {
    task(i * grain, std::min(n, (i + 1) * grain), worker);
  });
}

}  // namespace tilegrad
