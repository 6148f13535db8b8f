// SPDX-License-Identifier: Apache-2.0
// The program `tilegrad`. Exit codes: 0 done, 1 the work failed, 2 the command line or
// configuration is wrong, 3 an input file is missing or broken, 130 stopped by Ctrl-C and 143 by
// SIGTERM (state saved).
#include <fmt/core.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <new>
#include <sstream>
#include <system_error>

#include "base/error.h"
#include "base/simd_target.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/render_options.h"
#include "tilegrad/version.h"

namespace tilegrad::cli {
namespace {

int ExitCode(StatusCode code) {
  switch (code) {
    case StatusCode::kOk:
      return 0;
    case StatusCode::kInvalidArgument:
      return 2;
    case StatusCode::kNotFound:
    case StatusCode::kDataLoss:
      return 3;
    case StatusCode::kCancelled:
      return 128 + StopSignal();
    default:
      return 1;
  }
}

int Report(const Status& status) {
  if (!status.ok()) PrintNote("tilegrad: {}\n", status.message());
  return ExitCode(status.code());
}

// What was printed may still wait in memory: a full disk shows here.
Status FlushOutput() {
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return {};
  return {StatusCode::kIo, fmt::format("standard output: {}", std::strerror(errno))};
}

bool IsCommand(const CLI::App& app, const std::string& name) {
  return !app.get_subcommands([&](const CLI::App* command) { return command->get_name() == name; })
              .empty();
}

// An empty value is a variable that was not set: a folder of that name would be the current one.
Status CheckValues(const CLI::App& app) {
  for (const CLI::App* command : app.get_subcommands()) {
    for (const CLI::Option* option : command->get_options()) {
      for (const std::string& value : option->results()) {
        if (value.empty()) return InvalidArgument("{}: its value is empty", option->get_name());
      }
    }
  }
  return {};
}

int Run(int argc, char** argv) {
  CLI::App app("tilegrad: a differentiable rasterizer for CPUs, and the training system around it",
               "tilegrad");
  app.set_version_flag("--version", TILEGRAD_VERSION);
  app.require_subcommand(1);
  Action action;
  AddDataset(app, &action);
  AddTradeoff(app, &action);
  AddTrain(app, &action);
  AddEval(app, &action);
  AddPredict(app, &action);
  AddRender(app, &action);
  AddReport(app, &action);
  AddDatasetView(app, &action);
  AddFit(app, &action);
  AddViews(app, &action);
  AddFigure2(app, &action);
  AddInfo(app, &action);
  AddSelftest(app, &action);
  if (argc > 1 && argv[1][0] != '-' && !IsCommand(app, argv[1])) {
    return Report({StatusCode::kInvalidArgument,
                   fmt::format("unknown command \"{}\"; see tilegrad --help", argv[1])});
  }
  try {
    std::vector<std::string> words = JoinUpVector({argv + std::min(argc, 1), argv + argc});
    std::reverse(words.begin(), words.end());  // as CLI11 takes them
    app.parse(std::move(words));
  } catch (const CLI::ParseError& error) {
    std::ostringstream out, note;
    const int code = app.exit(error, out, note);
    Print("{}", out.str());
    PrintNote("{}", note.str());
    return code == 0 ? 0 : 2;
  }
  if (const Status status = CheckValues(app); !status.ok()) return Report(status);
  if (const Status status = ForceTargetFromEnvironment(); !status.ok()) return Report(status);
  const Status done = action();
  PrintThreadNotice();
  if (!done.ok()) return Report(done);
  return Report(FlushOutput());
}

}  // namespace
}  // namespace tilegrad::cli

int main(int argc, char** argv) {
  tilegrad::cli::OpenStandardStreams();
  tilegrad::cli::WritesFailWithoutSignals();
  try {
    return tilegrad::cli::Run(argc, argv);
  } catch (const std::bad_alloc&) {
    tilegrad::cli::PrintNote(
        "tilegrad: not enough memory; smaller images, batches or networks take less\n");
    return 1;
  } catch (const std::system_error& error) {  // what was printed has nowhere to go, for one
    const char* place = std::ferror(stdout) != 0 ? "standard output" : "the system refuses";
    tilegrad::cli::PrintNote("tilegrad: {}: {}\n", place, error.code().message());
    return 1;
  } catch (const std::exception& error) {  // a library that throws: still a sentence and a code
    tilegrad::cli::PrintNote("tilegrad: unexpected failure: {}\n", error.what());
    return 1;
  }
}
