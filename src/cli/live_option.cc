// SPDX-License-Identifier: Apache-2.0
#include "cli/live_option.h"

#include <cstdlib>

#include "base/error.h"
#include "cli/console.h"

namespace tilegrad::cli {
namespace {

bool HasDesktop() {
  return std::getenv("DISPLAY") != nullptr || std::getenv("WAYLAND_DISPLAY") != nullptr;
}

}  // namespace

void AddLiveOption(Command* command, bool* live) {
  command->Add("--live", live,
               "write live.html with curves, images and the mesh to the output folder as the run "
               "progresses; on a desktop, open it");
}

Status Live::Start(train::LiveSource source) {
  TILEGRAD_TRY(page_.emplace(std::move(source)).Start());
  ShowPage(*page_);
  return {};
}

ProgressSink Live::Sink(ProgressSink line) {
  return [this, line = std::move(line)](const Progress& progress) {
    if (page_) page_->Tell(progress);
    line(progress);
  };
}

void Live::Finish(const Status& outcome) {
  if (page_) EndPage(outcome, &*page_);
}

void EndPage(const Status& outcome, train::LivePage* page) {
  const Status problem = page->Finish(outcome);
  if (!problem.ok()) PrintNote("tilegrad: warning: live page: {}\n", problem.message());
}

void ShowPage(const train::LivePage& page) {
  const std::string address = train::FileAddress(page.file());
  PrintNote("live page: {}\n", address);
  if (!OutputIsTerminal() || !HasDesktop()) return;
  // An address has no character that a shell would obey.
  const std::string open = "xdg-open '" + address + "' >/dev/null 2>&1 </dev/null &";
  const int ended = std::system(open.c_str());
  static_cast<void>(ended);  // there may be no browser
}

}  // namespace tilegrad::cli
