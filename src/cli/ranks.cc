// SPDX-License-Identifier: Apache-2.0
#include "cli/ranks.h"

#include "base/error.h"
#include "cli/console.h"

namespace tilegrad::cli {

Status Ranks::Join() {
  if (train::LaunchedRanks() == 1) return {};
  TILEGRAD_ASSIGN(transport_, train::ConnectRanks());
  if (transport_->size() > 1) group_.emplace(*transport_);
  return {};
}

Ranks::~Ranks() {
  if (group_ && !group_->broken()) group_->Shutdown();
}

void Ranks::EndIfBroken(const Status& status) {
  if (status.ok() || !group_ || !group_->broken()) return;
  PrintNote("tilegrad: {}\n", status.message());
  std::fflush(nullptr);
  transport_->Abort(ExitCode(status.code()));
}

void Ranks::EndIfFailed(const Status& status) {
  if (status.ok() || !group_) return;
  if (!group_->leads()) group_->ReportError(status);
  group_->Break();
  EndIfBroken(status);
}

}  // namespace tilegrad::cli
