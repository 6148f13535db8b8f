// SPDX-License-Identifier: Apache-2.0
// The program on a pseudo-terminal of `columns` columns.
#pragma once

#include <pty.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <string>
#include <vector>

namespace tilegrad {

class TerminalProgram {
 public:
  // `arguments`: as RunProgram's, read by a shell that then becomes the program.
  TerminalProgram(const std::string& arguments, int columns) {
    const winsize size = SizeOf(columns);
    child_ = ::forkpty(&terminal_, nullptr, nullptr, &size);
    if (child_ != 0) return;
    const std::string command = std::string("exec ") + TILEGRAD_PROGRAM + " " + arguments;
    ::execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
    ::_exit(127);
  }
  ~TerminalProgram() {
    if (child_ > 0 && exit_code_ == kRuns) {
      ::kill(child_, SIGKILL);
      Finish();
    }
    ::close(terminal_);
  }
  TerminalProgram(const TerminalProgram&) = delete;
  TerminalProgram& operator=(const TerminalProgram&) = delete;

  // Whether the program prints `text` before it ends, after the first `from` bytes of its output.
  bool AwaitText(const std::string& text, std::size_t from = 0) {
    while (said_.find(text, from) == std::string::npos && Read()) {
    }
    return said_.find(text, from) != std::string::npos;
  }
  void Resize(int columns) {
    const winsize size = SizeOf(columns);
    ::ioctl(terminal_, TIOCSWINSZ, &size);
  }
  // Interrupts it as Ctrl-C does; seconds until it has ended.
  double Interrupt() {
    const auto start = std::chrono::steady_clock::now();
    ::kill(child_, SIGINT);
    Finish();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }
  // Waits for its end; the exit code as a shell reports it.
  int Finish() {
    while (Read()) {
    }
    int status = 0;
    if (exit_code_ == kRuns && ::waitpid(child_, &status, 0) == child_)
      exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    return exit_code_;
  }

  const std::string& said() const { return said_; }
  // The successive contents of lines, from byte `from` of the output: the text between carriage
  // returns and line breaks, without the code that erases the rest of a line.
  std::vector<std::string> Lines(std::size_t from = 0) const {
    std::vector<std::string> lines(1);
    for (std::size_t i = from; i < said_.size(); ++i) {
      if (said_.compare(i, 3, "\x1b[K") == 0) {
        i += 2;
      } else if (said_[i] == '\r' || said_[i] == '\n') {
        lines.emplace_back();
      } else {
        lines.back() += said_[i];
      }
    }
    return lines;
  }

 private:
  static constexpr int kRuns = -1;
  static winsize SizeOf(int columns) {
    winsize size = {};
    size.ws_row = 24;
    size.ws_col = static_cast<unsigned short>(columns);
    return size;
  }
  bool Read() {
    char buffer[4096];
    const ssize_t n = ::read(terminal_, buffer, sizeof(buffer));
    if (n > 0) said_.append(buffer, static_cast<std::size_t>(n));
    return n > 0;  // a terminal that nobody has open any more is an error
  }

  int terminal_ = -1, exit_code_ = kRuns;
  pid_t child_ = -1;
  std::string said_;
};

}  // namespace tilegrad
