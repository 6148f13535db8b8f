// SPDX-License-Identifier: Apache-2.0
#include "base/loop_team.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "base/clocks.h"
#include "base/parallel.h"

namespace tilegrad {
namespace {

// How long an idle member stays: longer than what stands between the loops of a training step.
constexpr double kStaySeconds = 200e-6;
constexpr int kLooksPerReading = 64;     // of the clock
constexpr int kLooksBeforeYield = 2000;  // 30 to 100 us: then another program may need the core
// Nested loops at a time, per member; more run on the thread that reaches them.
constexpr std::size_t kNestedLoops = 2;

void Pause() {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

// The teams whose tasks a thread is in, innermost first.
struct Membership {
  const LoopTeam* team;
  std::size_t worker;
  const Membership* outer;
};
thread_local const Membership* t_membership = nullptr;

const Membership* MembershipOf(const LoopTeam* team) {
  const Membership* found = t_membership;
  while (found != nullptr && found->team != team) found = found->outer;
  return found;
}

class Entering {
 public:
  Entering(const LoopTeam* team, std::size_t worker) : now_{team, worker, t_membership} {
    t_membership = &now_;
  }
  ~Entering() { t_membership = now_.outer; }
  Entering(const Entering&) = delete;
  Entering& operator=(const Entering&) = delete;

 private:
  const Membership now_;
};

}  // namespace

// One slot is reserved for the caller, who is worker 0 and never enters; members have 1 and more.
struct LoopTeam::Arena {
  explicit Arena(int count) : arena(count, /*reserved_for_masters=*/1) {}
  tbb::task_arena arena;
};

std::shared_ptr<LoopTeam> LoopTeam::Make(int count) {
  return std::shared_ptr<LoopTeam>(new LoopTeam(count));
}

LoopTeam::LoopTeam(int count)
    : members_(static_cast<std::size_t>(count) - 1),
      crowded_(count > AvailableCores()),
      arena_(std::make_unique<Arena>(count)),
      loops_(1 + kNestedLoops * static_cast<std::size_t>(count)) {}

LoopTeam::~LoopTeam() = default;

void LoopTeam::For(std::size_t n, Task task) {
  if (const Membership* const inside = MembershipOf(this); inside != nullptr) {
    RunNested(n, task, inside->worker);
    return;
  }
  const std::lock_guard lock(outermost_);
  const Entering entering(this, 0);
  Run(&loops_.front(), n, task, 0);
}

void LoopTeam::RunNested(std::size_t n, Task task, std::size_t worker) {
  for (std::size_t i = 1; i < loops_.size(); ++i) {
    OpenLoop& loop = loops_[i];
    if (loop.taken.load(std::memory_order_relaxed) || loop.taken.exchange(true)) continue;
    struct Leaving {
      ~Leaving() { loop.taken = false; }
      OpenLoop& loop;
    } const leaving{loop};
    Run(&loop, n, task, worker);
    return;
  }
  for (std::size_t i = 0; i < n; ++i) task(i, worker);
}

void LoopTeam::Run(OpenLoop* loop, std::size_t n, Task task, std::size_t worker) {
  if (n <= 1) {  // nothing to share
    for (std::size_t i = 0; i < n; ++i) task(i, worker);
    return;
  }
  loop->task = &task;
  loop->range_count = std::min({n, count(), kMostRanges});
  for (std::size_t r = 0; r < loop->range_count; ++r) {
    loop->ranges[r].next = r * n / loop->range_count;
    loop->ranges[r].end = (r + 1) * n / loop->range_count;
  }
  loop->failed.clear();
  loop->open = true;
  Announce();
  TakeTasks(loop, worker);
  for (int looks = 0; loop->inside != 0; ++looks) Wait(looks);
  if (const std::exception_ptr error = std::exchange(loop->error, nullptr); error != nullptr)
    std::rethrow_exception(error);
}

// A member that is about to leave sees the news, or this sees that it has left.
void LoopTeam::Announce() noexcept {
  ++news_;
  std::size_t present = present_;
  while (present < members_ && !present_.compare_exchange_weak(present, members_)) {
  }
  try {
    for (; present < members_; ++present)
      arena_->arena.enqueue([team = shared_from_this()] { team->Attend(); });
  } catch (...) {  // out of memory: those that are there do the work
    present_ -= members_ - present;
  }
}

void LoopTeam::TakeTasks(OpenLoop* loop, std::size_t worker) const {
  const Task& task = *loop->task;
  const std::size_t ranges = loop->range_count;
  std::size_t r = worker * ranges / count();
  try {
    for (std::size_t visited = 0; visited < ranges; ++visited, r = (r + 1) % ranges) {
      auto& [next, end] = loop->ranges[r];
      if (next.load(std::memory_order_relaxed) >= end) continue;
      for (std::size_t i = next++; i < end; i = next++) task(i, worker);
    }
  } catch (...) {
    if (!loop->failed.test_and_set()) loop->error = std::current_exception();
    for (std::size_t f = 0; f < ranges; ++f) loop->ranges[f].next = loop->ranges[f].end;
  }
  loop->open = false;
}

// Whether it was open.
bool LoopTeam::Join(OpenLoop* loop, std::size_t worker) const {
  if (!loop->open.load(std::memory_order_relaxed)) return false;
  ++loop->inside;
  const bool open = loop->open;  // after the increment, for which its caller now waits
  if (open) TakeTasks(loop, worker);
  --loop->inside;
  return open;
}

bool LoopTeam::JoinLoops(std::size_t worker) {
  bool joined = false;
  for (OpenLoop& loop : loops_) joined = Join(&loop, worker) || joined;
  return joined;
}

void LoopTeam::Attend() {
  ReserveThreadData();
  const auto worker = static_cast<std::size_t>(tbb::this_task_arena::current_thread_index());
  const Entering entering(this, worker);
  for (;;) {
    const unsigned seen = news_;
    if (TakeOffer() || JoinLoops(worker) || AwaitWork(seen)) continue;
    --present_;
    if (news_ == seen) return;
    ++present_;  // whoever announced it counted this member
  }
}

bool LoopTeam::IsIdle(unsigned seen) const {
  return news_.load(std::memory_order_relaxed) == seen &&
         dismissed_.load(std::memory_order_relaxed) != seen;
}

// Until the next look, of which there have been `looks`.
void LoopTeam::Wait(int looks) const {
  if (crowded_ || looks > kLooksBeforeYield) {
    std::this_thread::yield();
  } else {
    Pause();
  }
}

// False if there is none for some time, or none to be expected.
bool LoopTeam::AwaitWork(unsigned seen) const {
  const auto begin = std::chrono::steady_clock::now();
  for (int looks = 1; IsIdle(seen); ++looks) {
    if (looks % kLooksPerReading == 0 && SecondsSince(begin) > kStaySeconds) return false;
    Wait(looks);
  }
  return news_ != seen;
}

void LoopTeam::Offer(std::size_t times, const std::function<void()>& help) {
  {
    const std::lock_guard lock(offers_lock_);
    offers_.assign(times, help);
    offered_ = times;
  }
  Announce();
}

bool LoopTeam::TakeOffer() {
  if (offered_.load(std::memory_order_relaxed) == 0) return false;
  std::function<void()> help;
  {
    const std::lock_guard lock(offers_lock_);
    if (offers_.empty()) return false;
    help = std::move(offers_.back());
    offers_.pop_back();
    offered_ = offers_.size();
  }
  help();
  return true;
}

void LoopTeam::Dismiss() { dismissed_ = news_.load(); }

}  // namespace tilegrad
