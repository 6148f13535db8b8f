// SPDX-License-Identifier: Apache-2.0
#include "base/try_all.h"

#include <vector>

namespace tilegrad {

Status TryAll(const Workers& workers, std::size_t n, FallibleTask task, LoopSite site) {
  std::vector<Status> failures(n);
  workers.For(
      n, [&](std::size_t i, std::size_t worker) { failures[i] = task(i, worker); }, site);
  for (const Status& failure : failures) TILEGRAD_TRY(failure);
  return {};
}

Status TryAll(const Workers& workers, std::size_t n, const WatchedStage& stage, FallibleTask task,
              LoopSite site) {
  std::mutex mutex;
  std::uint64_t done = 0;
  const auto watched = [&](std::size_t i, std::size_t worker) -> Status {
    if (stage.watch.stopped()) return {};
    Status status = task(i, worker);
    const std::scoped_lock lock(mutex);
    stage.watch.Report({stage.name, ++done, n, ""});
    return status;
  };
  const Status all = TryAll(workers, n, watched, site);
  return stage.watch.stopped() ? Cancelled("stopped while {}", stage.name) : all;
}

}  // namespace tilegrad
