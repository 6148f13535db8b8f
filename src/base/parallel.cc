// SPDX-License-Identifier: Apache-2.0
#include "base/parallel.h"

#include <sched.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <optional>

namespace tilegrad {

struct Workers::Impl {
  explicit Impl(int count) : arena(count) {
    // More workers than cores (tests of determinism do that) must be allowed, or oneTBB prints a
    // warning.
    if (count > AvailableCores())
      limit.emplace(tbb::global_control::max_allowed_parallelism, count);
  }
  std::optional<tbb::global_control> limit;
  tbb::task_arena arena;
};

int AvailableCores() {
  cpu_set_t set;
  CPU_ZERO(&set);
  if (sched_getaffinity(0, sizeof(set), &set) != 0) return 1;
  return std::max(1, CPU_COUNT(&set));
}

Workers::Workers(int count)
    : count_(count > 0 ? count : AvailableCores()), impl_(std::make_unique<Impl>(count_)) {}

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
