// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <deque>

#include "base/parallel.h"

namespace tilegrad {

// The workers of a process in groups that work side by side. Where there is work for each, a group
// finishes it sooner than all workers finish one after the other: most loops are too short for
// many, and one worker needs no loop at all.
class WorkerGroups {
 public:
  // min(most, workers.count()) groups, at least one. Their sizes differ by one at most.
  WorkerGroups(const Workers& workers, std::size_t most);

  std::size_t count() const { return groups_.size(); }
  const Workers& group(std::size_t g) const { return groups_[g]; }
  // Of all workers, those of a group have numbers from here on, in its order: number first(g) + w
  // is worker w of group g. So scratch by worker of all can be used by groups.
  std::size_t first(std::size_t g) const { return FirstOf(g, all_.count(), count()); }

  // Calls task(g) once for each group and returns when all are done; errors as Workers::For. A
  // task's own loops are to be those of its group.
  void For(FunctionRef<void(std::size_t g)> task, LoopSite site = LoopSite::Here()) const;

  // The first worker of group g, in [0, groups]: g = groups is the end of the last.
  static std::size_t FirstOf(std::size_t g, int workers, std::size_t groups) {
    return g * static_cast<std::size_t>(workers) / groups;
  }

 private:
  const Workers& all_;
  std::deque<Workers> groups_;
};

}  // namespace tilegrad
