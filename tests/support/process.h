// SPDX-License-Identifier: Apache-2.0
// A program in its own process.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <string>
#include <vector>

#include "base/file.h"

namespace tilegrad {

// Starts the program words[0]; appends its output to `log`. `prepare` is called in the new process
// before the program is.
inline pid_t StartProcess(
    const std::vector<std::string>& words, const Path& log, void (*prepare)() = [] {}) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const pid_t child = ::fork();
  if (child != 0) return child;
  const int out = ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
  if (out < 0 || ::dup2(out, 1) < 0 || ::dup2(out, 2) < 0) ::_exit(126);
  prepare();
  ::execv(arguments[0], arguments.data());
  ::_exit(127);
}

// Waits for its end: the exit code, or the signal that ended it, as a negative number.
inline int EndProcess(pid_t child) {
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

}  // namespace tilegrad
