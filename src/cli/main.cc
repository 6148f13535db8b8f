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
#include "base/read_budget.h"
#include "base/simd_target.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/option_words.h"
#include "cli/parse_errors.h"
#include "cli/run_folder.h"
#include "tilegrad/version.h"
#include "train/ranks/launch.h"

namespace tilegrad::cli {
namespace {

int Report(const Status& status) {
  if (!status.ok()) PrintNote("tilegrad: {}\n", status.message());
  return ExitCode(status.code());
}

// What was printed may still wait in memory: a full disk shows here.
Status FlushOutput() {
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return {};
  return {StatusCode::kIo, fmt::format("standard output: {}", std::strerror(errno))};
}

// "help fit" is "fit --help".
void TurnHelpAround(std::vector<std::string>* words) {
  if (words->size() < 2 || (*words)[0] != "help" || (*words)[1].starts_with('-')) return;
  *words = {(*words)[1], "--help"};
}

// The first word is a command, or asks for help or the version, with or without dashes.
Status CheckFirstWord(const CLI::App& app, std::string* word) {
  std::vector<std::string> known;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    known.push_back(command->get_name());
  if (*word == "help" || *word == "version") word->insert(0, "--");
  if (std::find(known.begin(), known.end(), *word) != known.end()) return {};
  const std::vector<std::string> options = {"--help", "--version"};
  if (*word == "-h" || std::find(options.begin(), options.end(), *word) != options.end()) return {};
  const bool option = word->starts_with('-');
  return InvalidArgument("unknown {} \"{}\"{}; see tilegrad --help", option ? "option" : "command",
                         *word, DidYouMean(*word, option ? options : known));
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

// Other commands know nothing of other processes, which would write the same files.
Status CheckRanks(const CLI::App& app) {
  if (train::LaunchedRanks() == 1) return {};
  for (const char* command : {"train", "dataset", "eval"})
    if (app.got_subcommand(command)) return {};
  return InvalidArgument(
      "started as one of {} processes, but among the commands only train, dataset and eval share "
      "their work with others: start this one without mpirun",
      train::LaunchedRanks());
}

void AddCommands(CLI::App& app, Action* action) {
  for (const auto add :
       {AddDataset, AddTradeoff, AddTrain, AddEval, AddPredict, AddRender, AddReport, AddSample,
        AddLive, AddTimelapse, AddDatasetView, AddFit, AddViews}) {
    add(app, action);
  }
  for (CLI::App* reader : app.get_subcommands({})) AddReadLimitOption(reader);
  for (const auto add : {AddFigure2, AddInfo, AddSelftest}) add(app, action);
  for (CLI::App* worker : app.get_subcommands([](const CLI::App*) { return true; }))
    AddSpeechOptions(worker);
  for (const auto add : {AddConfigs, AddCompletion, AddMan}) add(app, action);
  EndOptions(app);
}

int Run(int argc, char** argv) {
  CLI::App app("tilegrad: a differentiable rasterizer for CPUs, and the training system around it",
               "tilegrad");
  app.footer(
      "tilegrad help COMMAND shows the options of a command; tilegrad configs, the networks "
      "that train knows by name.");
  app.set_version_flag("--version", TILEGRAD_VERSION);
  app.require_subcommand(1);
  Action action;
  AddCommands(app, &action);
  app.failure_message(ExplainParseError);
  std::vector<std::string> words = JoinLists({argv + std::min(argc, 1), argv + argc});
  TurnHelpAround(&words);
  if (!words.empty()) {
    if (const Status status = CheckFirstWord(app, &words[0]); !status.ok()) return Report(status);
  }
  try {
    std::reverse(words.begin(), words.end());  // as CLI11 takes them
    app.parse(std::move(words));
  } catch (const CLI::ParseError& error) {
    std::ostringstream out, note;
    const int code = app.exit(error, out, note);
    Print("{}", out.str());
    PrintNote("{}", note.str());
    return code == 0 ? 0 : 2;
  }
  for (const auto check : {CheckValues, CheckRanks}) {
    if (const Status status = check(app); !status.ok()) return Report(status);
  }
  if (const auto threads = ThreadsFromEnvironment(); !threads.ok()) return Report(threads.status());
  if (const auto limit = ReadLimit(); !limit.ok()) return Report(limit.status());
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
