// SPDX-License-Identifier: Apache-2.0
#include "bindings/shared_workers.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
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

// Never ended: a child must not touch what belongs to its parent's threads, and at the end of the
// process nobody waits for them.
Pool& ThePool() {
  static Pool* pool = new Pool;
  return *pool;
}

std::atomic<pid_t> owner = 0;  // the first process that asked

}  // namespace

const Workers& SharedWorkers(int threads) {
  pid_t nobody = 0;
  owner.compare_exchange_strong(nobody, getpid());
  if (owner != getpid()) {
    static const Workers* alone = new Workers(1);
    return *alone;
  }
  const int count = std::clamp(threads > 0 ? threads : AvailableCores(), 1, kMostThreads);
  Pool& pool = ThePool();
  const std::lock_guard lock(pool.mutex);
  std::unique_ptr<Workers>& workers = pool.workers[count];
  if (workers == nullptr) workers = std::make_unique<Workers>(count);
  return *workers;
}

}  // namespace tilegrad::python
