// SPDX-License-Identifier: Apache-2.0
#include "bindings/calls.h"

#include <pthread.h>

#include <algorithm>
#include <map>
#include <memory>
#include <mutex>

#include "base/aligned.h"

namespace tilegrad::python {
namespace {

struct Block {
  std::size_t bytes;
  void* data;
};

// Free blocks, in the order they came back. Guarded by the GIL; never freed at the end
// of the process, where arrays may outlive anything.
std::vector<Block>* const kept = new std::vector<Block>;
std::size_t kept_bytes = 0;

void Remove(std::vector<Block>::iterator block) {
  kept_bytes -= block->bytes;
  kept->erase(block);
}

void GiveBack(const Block& block) {
  kept->push_back(block);
  kept_bytes += block.bytes;
  while (kept_bytes > kMostKeptBytes) {
    FreeAligned(kept->front().data, kept->front().bytes);
    Remove(kept->begin());
  }
}

constexpr int kMostThreads = 1024;

struct Pool {
  std::mutex mutex;
  std::map<int, std::unique_ptr<Workers>> workers;
};

// Never ended: at exit, threads are not joined. A child of a fork has a pool of
// its own, since the parent's may have been locked at that moment.
Pool* the_pool = new Pool;
[[maybe_unused]] const int renewed_in_children =
    pthread_atfork(nullptr, nullptr, [] { the_pool = new Pool; });

}  // namespace

KeptBlock TakeKeptBlock(std::size_t bytes) {
  auto block = std::make_unique<Block>(Block{bytes, nullptr});
  const auto found =
      std::find_if(kept->rbegin(), kept->rend(), [&](const Block& b) { return b.bytes == bytes; });
  if (found != kept->rend()) {
    block->data = found->data;
    Remove(std::prev(found.base()));
  } else {
    block->data = AllocateAligned(bytes);
  }
  py::capsule owner(block.get(), [](void* p) {
    const std::unique_ptr<Block> dead(static_cast<Block*>(p));
    GiveBack(*dead);
  });
  return {block.release()->data, std::move(owner)};
}

const Workers& SharedWorkers(int threads) {
  const int count = std::clamp(threads > 0 ? threads : AvailableCores(), 1, kMostThreads);
  const std::lock_guard lock(the_pool->mutex);
  std::unique_ptr<Workers>& workers = the_pool->workers[count];
  if (workers == nullptr) workers = std::make_unique<Workers>(count);
  return *workers;
}

}  // namespace tilegrad::python
