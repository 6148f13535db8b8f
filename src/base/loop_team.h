// SPDX-License-Identifier: Apache-2.0
// How Workers run loops on the threads of oneTBB, whose own workers steal a loop's tasks from one
// another, and fall asleep when they find none: 40 microseconds to wake. A training step has a
// hundred loops and more that are no longer. The members of a team stay awake for a while instead,
// and see a loop at once.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

#include "base/function_ref.h"

namespace tilegrad {

// Threads that run loops together: that of the caller, and up to count - 1 members, which are tasks
// of a oneTBB arena. They are called when there is work, and return to oneTBB after some idle time.
// Where oneTBB has no thread to spare, loops run on fewer.
class LoopTeam : public std::enable_shared_from_this<LoopTeam> {
 public:
  using Task = FunctionRef<void(std::size_t index, std::size_t worker)>;

  static std::shared_ptr<LoopTeam> Make(int count);  // count >= 2
  ~LoopTeam();
  LoopTeam(const LoopTeam&) = delete;
  LoopTeam& operator=(const LoopTeam&) = delete;

  // Workers::For. A loop inside a task of this team's is open to idle members; while its caller
  // waits for them it takes no other tasks, so a worker's scratch is never entered twice. Loops of
  // several callers run one after the other.
  void For(std::size_t n, Task task);
  // `times` members, as they become idle, each call `help` once, before they join a loop; `help`
  // must not throw. Replaces the previous offer, as far as it has not been taken.
  void Offer(std::size_t times, const std::function<void()>& help);
  // Members that are idle return to oneTBB now instead of waiting for the next loop.
  void Dismiss();

 private:
  static constexpr std::size_t kMostRanges = 16;  // of a loop, so that its end is soon found
  struct alignas(64) Range {
    std::atomic<std::size_t> next{0};
    std::size_t end = 0;
  };
  // A loop while its tasks are being taken. Its place is reused, but never freed: members may look
  // at it at any time.
  struct alignas(64) OpenLoop {
    std::atomic<bool> taken{false};  // by a caller; not used for the outermost loop
    std::atomic<bool> open{false};   // may be entered
    std::size_t range_count = 0;     // constant while it is open, like task
    const Task* task = nullptr;
    std::atomic_flag failed;
    std::exception_ptr error;                        // the first
    alignas(64) std::atomic<std::size_t> inside{0};  // members, some of which find it closed
    // Tasks not yet taken. A worker begins with the same range in each loop of equal length, so
    // that it finds in its caches what it wrote in the previous one; then it helps with others.
    std::array<Range, kMostRanges> ranges;
  };
  struct Arena;

  explicit LoopTeam(int count);
  std::size_t count() const { return members_ + 1; }
  void Run(OpenLoop* loop, std::size_t n, Task task, std::size_t worker);
  void RunNested(std::size_t n, Task task, std::size_t worker);
  void Announce() noexcept;
  void Attend();
  bool TakeOffer();
  bool JoinLoops(std::size_t worker);
  bool IsIdle(unsigned seen) const;
  void Wait(int looks) const;
  bool AwaitWork(unsigned seen) const;
  void TakeTasks(OpenLoop* loop, std::size_t worker) const;
  bool Join(OpenLoop* loop, std::size_t worker) const;

  const std::size_t members_;
  const bool crowded_;  // more members than cores: waiting must not take the time of the others
  std::unique_ptr<Arena> arena_;
  std::mutex outermost_;
  std::vector<OpenLoop> loops_;                       // the outermost, and nested ones
  alignas(128) std::atomic<unsigned> news_{0};        // loops opened and offers made, so far
  std::atomic<unsigned> dismissed_{~0u};              // news_ at the last Dismiss
  alignas(128) std::atomic<std::size_t> present_{0};  // members called and not yet gone
  std::atomic<std::size_t> offered_{0};
  std::mutex offers_lock_;
  std::vector<std::function<void()>> offers_;
};

}  // namespace tilegrad
