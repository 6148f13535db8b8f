// SPDX-License-Identifier: Apache-2.0
#include "cli/console.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string_view>

#include "base/json_text.h"
#include "base/parallel.h"
#include "cli/command.h"
#include "io/guarded_process.h"

namespace tilegrad::cli {
namespace {

constexpr double kSilentSeconds = 1, kTerminalInterval = 0.2, kLogInterval = 10;
constexpr std::size_t kUsualColumns = 80;
constexpr std::string_view kEraseLine = "\x1b[K";

StopFlag g_stop = false;  // a signal handler can reach nothing but a global
volatile std::sig_atomic_t g_signal = SIGINT;

ProgressLine* g_line = nullptr;  // that is drawn now

bool g_quiet = false, g_json = false;  // of this process, set by its command line

extern "C" void HandleStop(int signal) {
  g_signal = signal;
  g_stop = true;
  std::signal(signal, SIG_DFL);
}

void StopOn(int signal) {
  if (std::signal(signal, HandleStop) == SIG_IGN) std::signal(signal, SIG_IGN);
}

double Seconds(std::chrono::steady_clock::duration d) {
  return std::chrono::duration<double>(d).count();
}

void WriteNote(std::string_view text) { std::fwrite(text.data(), 1, text.size(), stderr); }

std::size_t TerminalColumns() {
  winsize size = {};
  const bool known = ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0;
  return known ? size.ws_col : kUsualColumns;
}

// The longest prefix of UTF-8 text that surely fits: characters from Hangul on count as wide.
std::string_view FirstColumns(std::string_view text, std::size_t columns) {
  constexpr unsigned char kFirstWide = 0xE1;  // of three bytes or more, U+1000 and above
  std::size_t used = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    if ((byte & 0xC0) == 0x80) continue;  // continues a character
    used += byte >= kFirstWide ? 2 : 1;
    if (used > columns) return text.substr(0, i);
  }
  return text;
}

// "stage  12/820  1%  0:31 left  note"; `first`: done when the stage began.
std::string TextOf(const Progress& p, std::uint64_t first, double seconds) {
  std::string line = p.stage;
  if (p.total > 0) {
    line += fmt::format("  {}/{}  {:.0f}%", p.done, p.total,
                        100.0 * static_cast<double>(p.done) / static_cast<double>(p.total));
    if (p.done > first && p.done < p.total) {
      const double each = seconds / static_cast<double>(p.done - first);
      line +=
          fmt::format("  {} left", FormatDuration(each * static_cast<double>(p.total - p.done)));
    }
  } else if (p.done > 0) {
    line += fmt::format("  {}", p.done);
  } else if (seconds >= kSilentSeconds) {
    line += "  " + FormatDuration(seconds);
  }
  return p.note.empty() ? line : line + "  " + p.note;
}

}  // namespace

Verbosity CurrentVerbosity() {
  return g_json ? Verbosity::kJson : g_quiet ? Verbosity::kQuiet : Verbosity::kFull;
}

void AddVerbosityOptions(Command* command) {
  command->Add("--quiet", &g_quiet, "print warnings and errors only, no progress");
  command->Add("--json", &g_json,
               "print one JSON object on standard output at the end, for programs");
}

void PrintResult(const nlohmann::ordered_json& result) {
  if (!g_json) return;
  fmt::print("{}\n", JsonText(result, 2));
}

void OpenStandardStreams() {
  int fd = 0;
  while (fd >= 0 && fd <= STDERR_FILENO) fd = ::open("/dev/null", O_RDWR);
  if (fd > STDERR_FILENO) ::close(fd);  // all are open
}

bool OutputIsTerminal() {
  return CurrentVerbosity() == Verbosity::kFull && ::isatty(STDOUT_FILENO) == 1;
}

void PrintThreadNotice() {
  if (const char* notice = TakeThreadNotice()) PrintNote("tilegrad: warning: {}\n", notice);
}

void WritesFailWithoutSignals() {
  for (const int signal : {SIGPIPE, SIGXFSZ}) std::signal(signal, SIG_IGN);
}

std::string FormatDuration(double seconds) {
  const auto s = static_cast<long>(seconds + 0.5);
  if (s >= 3600) return fmt::format("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60);
  return fmt::format("{}:{:02}", s / 60, s % 60);
}

const StopFlag& StopOnSignals() {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) StopOn(signal);
  io::StopGuardedBy(&g_stop);
  return g_stop;
}

int StopSignal() { return g_signal; }

ProgressLine::ProgressLine() : terminal_(::isatty(STDERR_FILENO) == 1) {}
ProgressLine::~ProgressLine() { Finish(); }

ProgressSink ProgressLine::Sink() {
  return [this](const Progress& progress) { Show(progress); };
}

WarningSink ProgressLine::Warnings() {
  return [this](const std::string& warning) { PrintNote("tilegrad: warning: {}\n", warning); };
}

Watch ProgressLine::Watching() { return {Sink(), &StopOnSignals()}; }

double ProgressLine::Elapsed() const { return Seconds(Clock::now() - stage_start_); }

void ProgressLine::Show(const Progress& progress) {
  PrintThreadNotice();
  if (g_quiet) return;
  const auto now = Clock::now();
  if (progress.stage != last_.stage) {
    EndProgressLine();
    stage_start_ = now;
    first_done_ = progress.done;
    g_line = this;
  }
  last_ = progress;
  const double interval = terminal_ ? kTerminalInterval : kLogInterval;
  const bool wait =
      drawn_ ? Seconds(now - last_draw_) < interval : !terminal_ && Elapsed() < kSilentSeconds;
  if (wait) return;
  Draw();
  last_draw_ = now;
}

void ProgressLine::Draw() {
  std::string line = EscapeControls(TextOf(last_, first_done_, Elapsed()));
  std::replace_if(
      line.begin(), line.end(), [](char c) { return c == '\n' || c == '\t'; }, ' ');
  // In its last column the cursor of some terminals is in the next line already.
  const auto shown = FirstColumns(line, TerminalColumns() - 1);
  WriteNote(terminal_ ? fmt::format("\r{}{}", shown, kEraseLine) : line + "\n");
  drawn_ = true;
}

void ProgressLine::Finish() {
  const bool worth = !last_.stage.empty() && Elapsed() >= kSilentSeconds;
  if (worth) {
    Draw();
    if (terminal_) WriteNote("\n");
  } else if (drawn_ && terminal_) {
    WriteNote(fmt::format("\r{}", kEraseLine));
  }
  drawn_ = false;
  last_ = {};
  if (g_line == this) g_line = nullptr;
}

void EndProgressLine() {
  if (g_line != nullptr) g_line->Finish();
}

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

}  // namespace tilegrad::cli
