// SPDX-License-Identifier: Apache-2.0
#include "base/side_loop.h"

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "base/loop_trace.h"

namespace tilegrad {
namespace {

// One worker in four: with more, the caller's loops would have few workers at the start of the step
// and all of them later, when they are too short to use them.
constexpr int kWorkersToAHelper = 4;

std::size_t HelpersOf(int workers) {
  return workers == 1 ? 0 : static_cast<std::size_t>(std::max(1, workers / kWorkersToAHelper));
}

}  // namespace

struct SideLoop::State {
  using Lock = std::unique_lock<std::mutex>;

  std::mutex mutex;  // guards everything below
  std::condition_variable ended;
  Task task;
  std::size_t count = 0, next = 0, running = 0;  // tasks; next == count: all have begun
  std::vector<std::size_t> lanes;                // free lanes of helpers
  std::exception_ptr error;                      // the first

  void RunNext(Lock& lock, std::size_t lane) {
    const std::size_t index = next++;
    ++running;
    lock.unlock();
    std::exception_ptr thrown;
    try {
      task(index, lane);
    } catch (...) {
      thrown = std::current_exception();
    }
    lock.lock();
    if (thrown != nullptr) {
      next = count;
      if (error == nullptr) error = thrown;
    }
    if (--running == 0) ended.notify_all();
  }

  // As long as there are tasks.
  void Help() {
    Lock lock(mutex);
    if (lanes.empty()) return;
    const std::size_t lane = lanes.back();
    lanes.pop_back();
    while (next < count) RunNext(lock, lane);
    lanes.push_back(lane);
  }
};

struct SideLoop::Helpers {
  Helpers(const Workers& the_workers, State* state)
      : workers(the_workers), count(HelpersOf(workers.count())) {
    for (std::size_t i = count; i-- > 0;) state->lanes.push_back(workers.size() + i);
  }
  ~Helpers() { Join(); }
  Helpers(const Helpers&) = delete;
  Helpers& operator=(const Helpers&) = delete;

  void Wake(const std::shared_ptr<State>& state) {
    if (count == 0 || workers.Offer(count, [state] { state->Help(); })) return;
    try {
      own = std::thread([state] {
        ReserveThreadData();
        state->Help();
      });
    } catch (const std::system_error&) {  // Finish runs all tasks
    }
  }
  void Join() {
    if (own.joinable()) own.join();
  }

  const Workers& workers;
  std::size_t count;
  std::thread own;  // for one loop, if oneTBB is not used
};

SideLoop::SideLoop(const Workers& workers)
    : state_(std::make_shared<State>()),
      helpers_(std::make_unique<Helpers>(workers, state_.get())) {}

SideLoop::~SideLoop() {
  State::Lock lock(state_->mutex);
  state_->next = state_->count;
  state_->ended.wait(lock, [this] { return state_->running == 0; });
  state_->task = nullptr;
}

std::size_t SideLoop::LanesOf(const Workers& workers) {
  return workers.size() + HelpersOf(workers.count());
}

void SideLoop::Begin(std::size_t n, Task task, LoopSite site) {
  if (LoopTrace* const trace = helpers_->workers.trace_; trace != nullptr) {
    trace->Run(n, task, site, helpers_->count);
    return;
  }
  {
    const State::Lock lock(state_->mutex);
    state_->task = std::move(task);
    state_->next = 0;
    state_->count = n;
  }
  helpers_->Wake(state_);
}

void SideLoop::Finish() {
  State& state = *state_;
  State::Lock lock(state.mutex);
  const std::size_t waiting = state.count - state.next;
  lock.unlock();
  helpers_->workers.For(waiting, [&](std::size_t, std::size_t worker) {
    State::Lock own(state.mutex);
    if (state.next < state.count) state.RunNext(own, worker);
  });
  lock.lock();
  state.ended.wait(lock, [&] { return state.running == 0; });
  state.task = nullptr;
  const std::exception_ptr error = std::exchange(state.error, nullptr);
  lock.unlock();
  helpers_->Join();
  if (error != nullptr) std::rethrow_exception(error);
}

}  // namespace tilegrad
