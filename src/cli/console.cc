// SPDX-License-Identifier: Apache-2.0
#include "cli/console.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/parallel.h"
#include "cli/command.h"
#include "io/guarded_process.h"

namespace tilegrad::cli {
namespace {

constexpr double kSilentSeconds = 2, kTerminalInterval = 0.2, kLogInterval = 10;

StopFlag g_stop = false;  // a signal handler can reach nothing but a global
volatile std::sig_atomic_t g_signal = SIGINT;

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

}  // namespace

Speech SpeechNow() { return g_json ? Speech::kJson : g_quiet ? Speech::kQuiet : Speech::kFull; }

void AddSpeechOptions(Command* command) {
  command->Add("--quiet", &g_quiet, "print warnings and errors only, no progress");
  command->Add("--json", &g_json,
               "print one JSON object on standard output at the end, for programs");
}

void PrintResult(const nlohmann::ordered_json& result) {
  if (!g_json) return;
  fmt::print("{}\n", result.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
}

void OpenStandardStreams() {
  int fd = 0;
  while (fd >= 0 && fd <= STDERR_FILENO) fd = ::open("/dev/null", O_RDWR);
  if (fd > STDERR_FILENO) ::close(fd);  // all are open
}

std::string Count(std::size_t number, const std::string& thing) {
  return fmt::format("{} {}{}", number, thing, number == 1 ? "" : "s");
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
  return [this](const std::string& warning) {
    Finish();
    PrintNote("tilegrad: warning: {}\n", warning);
  };
}

void ProgressLine::Show(const Progress& progress) {
  const auto now = Clock::now();
  PrintThreadNotice();
  if (g_quiet) return;
  if (progress.stage != last_.stage) {
    Finish();
    stage_start_ = last_draw_ = now;
    first_done_ = progress.done;
  }
  last_ = progress;
  const double elapsed = Seconds(now - stage_start_);
  const double interval = terminal_ ? kTerminalInterval : kLogInterval;
  if (elapsed < kSilentSeconds || (drawn_ && Seconds(now - last_draw_) < interval)) return;
  Draw(progress, elapsed);
  last_draw_ = now;
}

void ProgressLine::Draw(const Progress& p, double seconds) {
  std::string line = p.stage;
  if (p.total > 0) {
    line += fmt::format("  {}/{}  {:.0f}%", p.done, p.total,
                        100.0 * static_cast<double>(p.done) / static_cast<double>(p.total));
    if (p.done > first_done_ && p.done < p.total) {
      const double each = seconds / static_cast<double>(p.done - first_done_);
      line +=
          fmt::format("  {} left", FormatDuration(each * static_cast<double>(p.total - p.done)));
    }
  } else {
    line += fmt::format("  {}", p.done);
  }
  if (!p.note.empty()) line += "  " + p.note;
  line = EscapeControls(line);
  line = terminal_ ? "\r" + line + "\x1b[K" : line + "\n";
  std::fwrite(line.data(), 1, line.size(), stderr);
  drawn_ = true;
}

void ProgressLine::Finish() {
  if (drawn_) {
    Draw(last_, Seconds(Clock::now() - stage_start_));
    if (terminal_) PrintNote("\n");
  }
  drawn_ = false;
  last_ = {};
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
