// SPDX-License-Identifier: Apache-2.0
// The terminal side of long work: a progress line with an ETA, and Ctrl-C that asks to stop instead
// of killing.
#pragma once

#include <fmt/core.h>

#include <chrono>
#include <cstdio>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "base/progress.h"
#include "base/text.h"
#include "tilegrad/status.h"

namespace tilegrad::cli {

struct Command;

// What the program prints besides errors.
enum class Verbosity {
  kFull,
  kQuiet,  // --quiet: only warnings and errors
  kJson,   // --json: at the end one JSON object on stdout, instead of sentences
};
Verbosity CurrentVerbosity();
// --quiet and --json, for every command that prints results.
void AddVerbosityOptions(Command* command);

// The result of a command, for programs: printed only under --json.
void PrintResult(const nlohmann::ordered_json& result);

// Ends the current progress line, so that output starts on a new line.
void EndProgressLine();

// As fmt::print to stdout, unless --quiet or --json. Escapes what a terminal would obey
// (EscapeControls): names of files and models, and anything else from strangers, may hold such
// codes.
template <class... Args>
void Print(fmt::format_string<Args...> format, Args&&... args) {
  if (CurrentVerbosity() != Verbosity::kFull) return;
  EndProgressLine();
  fmt::print("{}", EscapeControls(fmt::format(format, std::forward<Args>(args)...)));
}

// The same to stderr, but ignores write errors (a full disk, a closed stream), which must not end
// hours of work.
template <class... Args>
void PrintNote(fmt::format_string<Args...> format, Args&&... args) {
  const std::string text = EscapeControls(fmt::format(format, std::forward<Args>(args)...));
  EndProgressLine();
  std::fwrite(text.data(), 1, text.size(), stderr);
}

// The same for remarks that are no warnings: silent under --quiet.
template <class... Args>
void PrintRemark(fmt::format_string<Args...> format, Args&&... args) {
  if (CurrentVerbosity() != Verbosity::kQuiet) PrintNote(format, std::forward<Args>(args)...);
}

// Whether stdout is read interactively.
bool OutputIsTerminal();

// Prints once that the system has refused threads.
void PrintThreadNotice();

// Opens those of the three standard streams that are closed on /dev/null: otherwise the first files
// opened would get their descriptors, and the progress line would be written into a checkpoint.
void OpenStandardStreams();

// Makes writing to a closed pipe, or beyond the limit of a file's size, an ordinary error instead
// of a signal that ends the process.
void WritesFailWithoutSignals();

// Draws "stage  12/820  1%  0:31 left  note" on stderr. On a terminal at once, rewritten in place
// and cut to its current width; stages of less than a second leave nothing. Elsewhere a line every
// ten seconds, and one for each stage of a second or more. Nothing with --quiet. Finish() (or a new
// stage, any output, or the destructor) ends the line.
class ProgressLine {
 public:
  ProgressLine();
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  ProgressSink Sink();     // valid while this lives
  WarningSink Warnings();  // likewise; ends the line and prints
  Watch Watching();        // likewise; signals stop the work
  void Finish();

 private:
  using Clock = std::chrono::steady_clock;
  void Show(const Progress& progress);
  void Draw();
  double Elapsed() const;

  bool terminal_;
  bool drawn_ = false;  // something of this stage is on the screen
  Progress last_;
  std::uint64_t first_done_ = 0;  // done at the start of the stage: earlier steps of a resumed run
                                  // do not count for its speed
  Clock::time_point stage_start_, last_draw_;
};

// "1:05:09", "3:07" or "0:04".
std::string FormatDuration(double seconds);

// A flag that SIGINT, SIGTERM and SIGHUP (the terminal is gone) set; installed at the first call,
// and checked by the readers of files. A second signal kills as usual. Signals ignored by the
// parent (nohup, a shell's background) stay ignored.
const StopFlag& StopOnSignals();
// The last signal that set it; SIGINT if none has.
int StopSignal();

// The program's exit code for the outcome of its work: see main.cc.
int ExitCode(StatusCode code);

}  // namespace tilegrad::cli
