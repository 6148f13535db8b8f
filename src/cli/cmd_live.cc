// SPDX-License-Identifier: Apache-2.0
// tilegrad live: a page about a run that goes on, is over, or was killed.
#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "base/error.h"
#include "base/file.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/live_server.h"
#include "cli/run_folder.h"

namespace tilegrad::cli {
namespace {

struct LiveOptions {
  std::string run, data;
  int port = 0;
};

// Only runs of train have a dataset; without it the page has no meshes of them.
Path DatasetOf(const LiveOptions& options) {
  if (options.data.empty() && !PathExists(Path(options.run) / "run.json")) return {};
  const auto data = ChooseDataset(options.data, options.run);
  if (data.ok()) return *data;
  PrintNote("tilegrad: warning: {}: no meshes are shown\n", data.status().message());
  return {};
}

Status RunLive(const LiveOptions& options) {
  TILEGRAD_TRY(CheckIsRun(options.run));
  const StopFlag& stop = StopOnSignals();
  TILEGRAD_ASSIGN(const LiveServer server,
                  LiveServer::Start({options.run, DatasetOf(options)}, options.port));
  PrintResult({{"address", server.address()}});
  std::fflush(stdout);
  PrintRemark("Ctrl-C ends it\n");
  while (!stop) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  return {};
}

}  // namespace

void AddLive(CommandList* list) {
  const auto [command, options] = AddCommand(
      list, "live", "Show a run or a fit in the browser: as it goes on, or after it has ended",
      RunLive);
  command->Add("run", &options->run, "folder of a training or a fit", {Required{}});
  command->Add("--data", &options->data, "dataset folder [the one it was trained on]");
  command->Add("--port", &options->port, "of 127.0.0.1; 0: 8642, or any that is free",
               {Range{0, 65535}});
}

}  // namespace tilegrad::cli
