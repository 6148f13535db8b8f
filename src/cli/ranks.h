// SPDX-License-Identifier: Apache-2.0
// The processes that mpirun started, for commands that share their work.
#pragma once

#include <memory>
#include <optional>

#include "base/error.h"
#include "cli/console.h"
#include "train/ranks/launch.h"
#include "train/ranks/process_group.h"

namespace tilegrad::cli {

class Ranks {
 public:
  Ranks() = default;
  // Waits for all, unless they are broken.
  ~Ranks() {
    if (group_ && !group_->broken()) group_->Shutdown();
  }
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;
  // Joins them; alone without mpirun.
  Status Join() {
    if (train::LaunchedRanks() == 1) return {};
    TILEGRAD_ASSIGN(transport_, train::ConnectRanks());
    if (transport_->size() > 1) group_.emplace(*transport_);
    return {};
  }

  train::ProcessGroup* group() { return group_ ? &*group_ : nullptr; }  // null: alone
  // Whether rank 0 reports for this process.
  bool follows() const { return group_ && !group_->leads(); }
  // ProcessGroup::Agree on the status of all; alone `own`.
  Status Agree(const Status& own) { return group_ ? group_->Agree(own, {}) : own; }
  // `status`; but if all agreed to end, a follower leaves the report to rank 0.
  Status Reportable(const Status& status) const {
    return follows() && status.code() == StatusCode::kCancelled ? Status() : status;
  }
  // After an error that leaves the others waiting: prints the message and ends all.
  void EndIfBroken(const Status& status) {
    if (status.ok() || !group_ || !group_->broken()) return;
    PrintNote("tilegrad: {}\n", status.message());
    std::fflush(nullptr);
    transport_->Abort(ExitCode(status.code()));
  }
  // The same after work that each rank does by itself, with its own `status`.
  void EndIfFailed(const Status& status) {
    if (status.ok() || !group_) return;
    if (!group_->leads()) group_->ReportError(status);
    group_->Break();
    EndIfBroken(status);
  }
  int Workers(int asked) const { return group_ ? train::PlaceRank(asked) : asked; }

 private:
  std::unique_ptr<train::Transport> transport_;
  std::optional<train::ProcessGroup> group_;
};

}  // namespace tilegrad::cli
