// SPDX-License-Identifier: Apache-2.0
// Prefetching: reads, renders and augments the pictures of a step during the step before
// (base/side_loop.h), to keep workers busy for which that step's loops have no task. A batch
// depends only on its place in the run: who makes it, and when, changes no bit.
#pragma once

#include <functional>
#include <optional>

#include "base/side_loop.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

// A batch in preparation: its memory is allocated, and each task fills a part.
template <class Batch>
struct BatchWork {
  std::size_t tasks = 0;
  SideLoop::Task run;  // called by several threads, each with a lane of its own
  // Called once, after all tasks, on the context's thread: the batch, or the error.
  std::function<Result<Batch>()> finish;
};

// Does the work now, on all workers. Lanes are workers.
template <class Batch>
Result<Batch> MakeNow(const BatchWork<Batch>& work, const Workers& workers) {
  workers.For(work.tasks, work.run);
  return work.finish();
}

template <class Batch>
class NextBatch {
 public:
  explicit NextBatch(const Workers& workers) : loop_(workers) {}

  // Returns the batch of `at` and starts on that of at.next. `make`: BatchIndex ->
  // BatchWork<Batch>.
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

  // Waits for the batch in preparation.
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
  SideLoop loop_;  // last: ends before its work is destroyed
};

}  // namespace tilegrad::train
