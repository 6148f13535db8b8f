// SPDX-License-Identifier: Apache-2.0
// tilegrad live: live view of a running, finished or interrupted run.
#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "base/error.h"
#include "base/file.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/live_option.h"
#include "cli/run_folder.h"
#include "fit/run.h"

namespace tilegrad::cli {
namespace {

struct LiveOptions {
  std::string run, data;
};

// Only runs of train have a dataset; without it the page has no meshes of them.
Path DatasetOf(const LiveOptions& options) {
  if (options.data.empty() && !PathExists(Path(options.run) / "run.json")) return {};
  const auto data = ChooseDataset(options.data, options.run);
  if (data.ok()) return *data;
  PrintNote("tilegrad: warning: {}: no meshes are shown\n", data.status().message());
  return {};
}

// Until the run ends.
void KeepPage(const Path& run, train::LivePage* page) {
  const StopFlag& stop = StopOnSignals();
  PrintRemark("updating it until the run ends; Ctrl-C stops the updates, not the run\n");
  while (!stop && FolderLock::IsHeld(run)) {
    page->Tell({});
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
}

Status RunLive(const LiveOptions& options) {
  const Path run = options.run;
  TILEGRAD_TRY(CheckIsRun(run));
  train::LivePage page({run, DatasetOf(options), 0, train::FitLabels()});
  const bool kept = train::LivePage::IsKept(run);
  if (!kept) TILEGRAD_TRY(page.Start());
  ShowPage(page);
  PrintResult({{"page", page.file().string()}, {"address", train::FileAddress(page.file())}});
  std::fflush(stdout);
  if (kept) return {};
  if (FolderLock::IsHeld(run)) KeepPage(run, &page);
  if (!FolderLock::IsHeld(run)) EndPage({}, &page);
  return {};
}

}  // namespace

void AddLive(CommandList* list) {
  const auto [command, options] = AddCommand(
      list, "live", "Live view of a running, finished or interrupted run in the browser", RunLive);
  command->Add("run", &options->run, "folder of a training run or a fit", {Required{}});
  command->Add("--data", &options->data, "dataset folder [the training dataset]");
}

}  // namespace tilegrad::cli
