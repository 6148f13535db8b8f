// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <deque>

#include "base/parallel.h"

namespace tilegrad {

// Divides the workers of a process into groups that compute side by side. Most loops are too short
// for many workers, so with independent work for each group this is faster than all workers on one
// piece after the other; a group of one worker forks nothing.
class WorkerGroups {
 public:
  // min(most, workers.count()) groups, at least one. Their sizes differ by one at most.
  WorkerGroups(const Workers& workers, std::size_t most);

  std::size_t count() const { return groups_.size(); }
  const Workers& group(std::size_t g) const { return groups_[g]; }
  // Worker w of group g is worker first(g) + w of all, so that groups can share scratch that is
  // indexed by worker.
  std::size_t first(std::size_t g) const { return FirstOf(g, all_.count(), count()); }

  // Calls task(g) once for each group and returns when all are done; errors as Workers::For. A task
  // must run its own loops on its group.
  void For(FunctionRef<void(std::size_t g)> task, LoopSite site = LoopSite::Here()) const;

  // The first worker of group g; g = groups gives the end of the last group.
  static std::size_t FirstOf(std::size_t g, int workers, std::size_t groups) {
    return g * static_cast<std::size_t>(workers) / groups;
  }

 private:
  const Workers& all_;
  std::deque<Workers> groups_;
};

}  // namespace tilegrad
