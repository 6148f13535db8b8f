// SPDX-License-Identifier: Apache-2.0
// The pictures of a step are read, drawn and changed beside the step before (base/side_loop.h), so
// that workers for whom its loops have no task are busy. What is in a batch follows from its place
// in the run alone: who makes it, and when, changes no bit.
#pragma once

#include <functional>
#include <optional>

#include "base/side_loop.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

// A batch that is being made: its memory is there, each task fills a part.
template <class Batch>
struct BatchWork {
  std::size_t tasks = 0;
  SideLoop::Task run;  // called by several threads, each with a lane of its own
  // The batch, once all tasks are done, or why there is none. On the context's thread, once.
  std::function<Result<Batch>()> finish;
};

// On all workers, now. Lanes are workers.
template <class Batch>
Result<Batch> MakeNow(const BatchWork<Batch>& work, const Workers& workers) {
  workers.For(work.tasks, work.run);
  return work.finish();
}

template <class Batch>
class NextBatch {
 public:
  explicit NextBatch(const Workers& workers) : loop_(workers) {}

  // The batch of `at`, and that of at.next is begun. `make`: BatchIndex -> BatchWork<Batch>.
  template <class Make>
  Result<Batch> Take(const UpdateIndex& at, const Make& make) {
    const BatchIndex now{at.step, at.portion};
    if (begun_ != now) Begin(now, make);
    loop_.Finish();
    begun_.reset();
    Result<Batch> batch = work_.finish();
    if (at.next) Begin(*at.next, make);
    return batch;
  }

  // Waits until what has begun is ready.
  void Settle() { loop_.Finish(); }

 private:
  template <class Make>
  void Begin(const BatchIndex& index, const Make& make) {
    loop_.Finish();
    work_ = make(index);
    begun_ = index;
    loop_.Begin(work_.tasks, work_.run);
  }

  BatchWork<Batch> work_;
  std::optional<BatchIndex> begun_;
  SideLoop loop_;  // last: it ends before its work goes
};

}  // namespace tilegrad::train
