// SPDX-License-Identifier: Apache-2.0
// The processes that mpirun started, for commands that share their work.
#pragma once

#include <memory>
#include <optional>

#include "tilegrad/status.h"
#include "train/ranks/crew.h"
#include "train/ranks/launch.h"

namespace tilegrad::cli {

class Ranks {
 public:
  Ranks() = default;
  ~Ranks();  // waits for all, unless they are broken
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;
  // Joins them; alone without mpirun.
  Status Join();

  train::Crew* crew() { return crew_ ? &*crew_ : nullptr; }  // null: alone
  // Whether rank 0 speaks for this process.
  bool follows() const { return crew_ && !crew_->leads(); }
  // Crew::Agree on how all fared so far; alone `own`.
  Status Agree(const Status& own) { return crew_ ? crew_->Agree(own, {}) : own; }
  // `status`, but that all agreed to end, which a follower leaves to rank 0 to say.
  Status Told(const Status& status) const {
    return follows() && status.code() == StatusCode::kCancelled ? Status() : status;
  }
  // After an error that leaves the others waiting: the message, then the end of all.
  void EndIfBroken(const Status& status);
  // The same of work that each rank does by itself: `status` of its own.
  void EndIfFailed(const Status& status);
  int Workers(int asked) const { return crew_ ? train::PlaceRank(asked) : asked; }

 private:
  std::unique_ptr<train::Transport> transport_;
  std::optional<train::Crew> crew_;
};

}  // namespace tilegrad::cli
