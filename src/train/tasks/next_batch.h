// SPDX-License-Identifier: Apache-2.0
// Prefetching: makes the pictures of a step during the step before (base/side_loop.h), on workers
// that would be idle. A batch depends only on its place in the run: who makes it, and when, changes
// no bit. A lane of the context has no idle workers and makes its batches when it needs them.
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
  // Called once, after all tasks, on the thread that began the work: the batch, or the error.
  std::function<Result<Batch>()> finish;
};

// Does the work now, on all workers of the context or of its lane.
template <class Batch>
Result<Batch> MakeNow(const BatchWork<Batch>& work, const nn::Context& context) {
  const std::size_t first = context.first_worker();
  context.workers().For(work.tasks,
                        [&](std::size_t i, std::size_t worker) { work.run(i, first + worker); });
  return work.finish();
}

template <class Batch>
class NextBatch {
 public:
  explicit NextBatch(const nn::Context& context) : context_(context), loop_(context.workers()) {}

  // Returns the batch of `at` and starts on that of at.next. `make`: BatchIndex ->
  // BatchWork<Batch>.
  template <class Make>
  Result<Batch> Take(const UpdateIndex& at, const Make& make) {
    const BatchIndex now{at.step, at.portion};
    if (context_.lane() > 0) return MakeNow(make(now), context_);
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

  const nn::Context& context_;
  BatchWork<Batch> work_;
  std::optional<BatchIndex> begun_;
  SideLoop loop_;  // last: ends before its work is destroyed
};

}  // namespace tilegrad::train
