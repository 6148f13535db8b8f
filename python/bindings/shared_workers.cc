// SPDX-License-Identifier: Apache-2.0
#include "bindings/shared_workers.h"

#include <pthread.h>

#include <algorithm>
#include <map>
#include <memory>
#include <mutex>

namespace tilegrad::python {
namespace {

constexpr int kMostThreads = 1024;

struct Pool {
  std::mutex mutex;
  std::map<int, std::unique_ptr<Workers>> workers;
};

// Never ended: at the end of the process nobody waits for threads. A child of a fork has a pool of
// its own, since the parent's may have been locked at that moment.
Pool* the_pool = new Pool;
[[maybe_unused]] const int renewed_in_children =
    pthread_atfork(nullptr, nullptr, [] { the_pool = new Pool; });

}  // namespace

const Workers& SharedWorkers(int threads) {
  const int count = std::clamp(threads > 0 ? threads : AvailableCores(), 1, kMostThreads);
  const std::lock_guard lock(the_pool->mutex);
  std::unique_ptr<Workers>& workers = the_pool->workers[count];
  if (workers == nullptr) workers = std::make_unique<Workers>(count);
  return *workers;
}

}  // namespace tilegrad::python
