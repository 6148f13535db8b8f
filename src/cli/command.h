// SPDX-License-Identifier: Apache-2.0
// The commands of the program. Each lives in its own file cmd_<name>.cc, declares its options on a
// CLI11 subcommand and, when chosen, returns a Status whose message the program prints; main.cc
// alone maps it to an exit code.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

#include "tilegrad/status.h"

namespace tilegrad::cli {

// What a chosen subcommand does once options are parsed.
using Action = std::function<Status()>;

// Adds a subcommand to `app`; when it is given on the command line, sets *action.
void AddCompletion(CLI::App& app, Action* action);
void AddConfigs(CLI::App& app, Action* action);
void AddDataset(CLI::App& app, Action* action);
void AddDatasetView(CLI::App& app, Action* action);
void AddEval(CLI::App& app, Action* action);
void AddFigure2(CLI::App& app, Action* action);
void AddFit(CLI::App& app, Action* action);
void AddInfo(CLI::App& app, Action* action);
void AddLive(CLI::App& app, Action* action);
void AddMan(CLI::App& app, Action* action);
void AddPredict(CLI::App& app, Action* action);
void AddRender(CLI::App& app, Action* action);
void AddReport(CLI::App& app, Action* action);
void AddSample(CLI::App& app, Action* action);
void AddSelftest(CLI::App& app, Action* action);
void AddTimelapse(CLI::App& app, Action* action);
void AddTradeoff(CLI::App& app, Action* action);
void AddTrain(CLI::App& app, Action* action);
void AddViews(CLI::App& app, Action* action);

}  // namespace tilegrad::cli
