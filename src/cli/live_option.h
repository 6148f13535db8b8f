// SPDX-License-Identifier: Apache-2.0
// --live: the page of a run (train/report/live_page.h) while a command works.
#pragma once

#include <optional>

#include "cli/command.h"
#include "train/report/live_page.h"

namespace tilegrad::cli {

void AddLiveOption(Command* command, bool* live);

// A page, if started.
class Live {
 public:
  // In the folder of a run that this process holds.
  Status Start(train::LiveSource source);
  // Forwards progress to `line` and to the page. Valid while this lives.
  ProgressSink Sink(ProgressSink line);
  // As EndPage.
  void Finish(const Status& outcome);

 private:
  std::optional<train::LivePage> page_;
};

// LivePage::Finish; problems with the page are warnings.
void EndPage(const Status& outcome, train::LivePage* page);
// Prints the page's address, and opens it on a desktop.
void ShowPage(const train::LivePage& page);

}  // namespace tilegrad::cli
