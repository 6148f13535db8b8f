// SPDX-License-Identifier: Apache-2.0
#include "base/worker_groups.h"

#include <algorithm>
#include <atomic>

#include "base/loop_trace.h"

namespace tilegrad {

WorkerGroups::WorkerGroups(const Workers& workers, std::size_t most) : all_(workers) {
  const auto count =
      std::clamp<std::size_t>(most, 1, static_cast<std::size_t>(std::max(1, workers.count())));
  for (std::size_t g = 0; g < count; ++g) {
    const auto size = static_cast<int>(FirstOf(g + 1, workers.count(), count) -
                                       FirstOf(g, workers.count(), count));
    if (workers.trace_ != nullptr) {
      groups_.emplace_back(size, workers.trace_);
    } else {
      groups_.emplace_back(size);
    }
  }
}

void WorkerGroups::For(FunctionRef<void(std::size_t)> task, LoopSite site) const {
  std::atomic<std::size_t> waiting = count();
  // Workers without a task would keep threads from the groups, and so would those of a group that
  // is done.
  const auto run = [&](std::size_t g) {
    if (--waiting == 0) all_.Dismiss();
    task(g);
    group(g).Dismiss();
  };
  if (all_.trace_ != nullptr) {
    all_.trace_->RunTasks({.tasks = count(), .site = site, .grouped = true}, run);
  } else {
    all_.For(count(), run, site);
  }
}

}  // namespace tilegrad
