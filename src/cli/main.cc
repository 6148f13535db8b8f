// SPDX-License-Identifier: Apache-2.0
// The program `tilegrad`. Exit codes: 0 done, 1 the work failed, 2 the command line or
// configuration is wrong, 3 an input file is missing or broken, 130 stopped by Ctrl-C and 143 by
// SIGTERM (state saved), 141 if stdout is a closed pipe.
#include <fmt/core.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <new>
#include <system_error>

#include "base/error.h"
#include "base/read_budget.h"
#include "base/simd_target.h"
#include "base/text.h"
#include "cli/command.h"
#include "cli/command_line.h"
#include "cli/console.h"
#include "cli/run_folder.h"
#include "tilegrad/version.h"
#include "train/ranks/launch.h"

namespace tilegrad::cli {
namespace {

int Report(const Status& status) {
  if (!status.ok()) PrintNote("tilegrad: {}\n", status.message());
  return ExitCode(status.code());
}

// The exit code when output cannot be written: a full disk is an error; a reader that has seen
// enough, such as `head`, ends us as its signal would.
int OutputLost(int error) {
  if (error != EPIPE) PrintNote("tilegrad: standard output: {}\n", std::strerror(error));
  return error == EPIPE ? 128 + SIGPIPE : 1;
}

// Output may still be buffered.
int FlushOutput(int exit_code) {
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return exit_code;
  return OutputLost(errno);
}

// "help fit" is "fit --help".
void TurnHelpAround(std::vector<std::string>* words) {
  if (words->size() < 2 || (*words)[0] != "help" || (*words)[1].starts_with('-')) return;
  *words = {(*words)[1], "--help"};
}

// The first word is a command, or asks for help or the version, with or without dashes.
Status CheckFirstWord(const CommandList& commands, std::string* word) {
  std::vector<std::string> known;
  for (const Command& command : commands) known.push_back(command.name);
  if (*word == "help" || *word == "version") word->insert(0, "--");
  if (std::find(known.begin(), known.end(), *word) != known.end()) return {};
  const std::vector<std::string> options = {"--help", "--version"};
  if (*word == "-h" || std::find(options.begin(), options.end(), *word) != options.end()) return {};
  const bool option = word->starts_with('-');
  return InvalidArgument("unknown {} \"{}\"{}; see tilegrad --help", option ? "option" : "command",
                         *word, DidYouMean(*word, option ? options : known));
}

// An empty value is a variable that was not set: a folder of that name would be the current one.
Status CheckValues(const Command& command) {
  for (const Option& option : command.options) {
    for (const std::string& word : option.words) {
      if (word.empty()) return InvalidArgument("{}: the value is empty", option.FirstName());
    }
  }
  return {};
}

// Other commands know nothing of other processes, which would write the same files.
Status CheckRanks(const Command& command) {
  if (train::LaunchedRanks() == 1) return {};
  for (const char* name : {"train", "dataset", "eval"})
    if (command.name == name) return {};
  return InvalidArgument(
      "started as one of {} processes, but only train, dataset and eval run on several; start this "
      "command without mpirun",
      train::LaunchedRanks());
}

void AddCommands(CommandList* list) {
  for (const auto add :
       {AddDataset, AddTradeoff, AddTrain, AddEval, AddPredict, AddExport, AddRender, AddReport,
        AddSample, AddLive, AddTimelapse, AddDatasetView, AddFit, AddViews, AddInfo, AddProfile}) {
    add(list);
  }
  for (Command& reader : *list) AddReadLimitOption(&reader);
  AddSelftest(list);
  for (Command& worker : *list) AddVerbosityOptions(&worker);
  for (const auto add : {AddConfigs, AddCompletion, AddMan}) add(list);
}

int RunProgram(int argc, char** argv) {
  CommandList commands;
  AddCommands(&commands);
  std::vector<std::string> words = JoinLists({argv + std::min(argc, 1), argv + argc});
  TurnHelpAround(&words);
  if (!words.empty()) {
    const Status status = CheckFirstWord(commands, &words[0]);
    if (!status.ok()) return Report(status);
  }
  const ParsedLine line = ParseLine(std::move(words), &commands);
  if (line.command == nullptr) {
    Print("{}", line.out);
    PrintNote("{}", line.note);
    return FlushOutput(line.exit_code);
  }
  for (const auto check : {CheckValues, CheckRanks}) {
    if (const Status status = check(*line.command); !status.ok()) return Report(status);
  }
  if (const auto threads = ThreadsFromEnvironment(); !threads.ok()) return Report(threads.status());
  if (const auto limit = ReadLimit(); !limit.ok()) return Report(limit.status());
  if (const Status status = ForceTargetFromEnvironment(); !status.ok()) return Report(status);
  const Status done = line.command->action();
  PrintThreadNotice();
  return done.ok() ? FlushOutput(0) : Report(done);
}

}  // namespace
}  // namespace tilegrad::cli

int main(int argc, char** argv) {
  tilegrad::cli::OpenStandardStreams();
  tilegrad::cli::WritesFailWithoutSignals();
  try {
    return tilegrad::cli::RunProgram(argc, argv);
  } catch (const std::bad_alloc&) {
    tilegrad::cli::PrintNote("tilegrad: out of memory; try smaller images, batches or networks\n");
    return 1;
  } catch (const std::system_error& error) {  // for example, output cannot be written
    if (std::ferror(stdout) != 0) return tilegrad::cli::OutputLost(error.code().value());
    tilegrad::cli::PrintNote("tilegrad: system error: {}\n", error.code().message());
    return 1;
  } catch (const std::exception& error) {  // a library that throws: still a sentence and a code
    tilegrad::cli::PrintNote("tilegrad: unexpected failure: {}\n", error.what());
    return 1;
  }
}
