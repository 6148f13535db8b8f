// SPDX-License-Identifier: Apache-2.0
// The program itself, as a person starts it.
#pragma once

#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <string>

namespace tilegrad {

struct Outcome {
  int exit_code = -1;  // -1: ended by a signal
  std::string output;  // both streams
};

// `before`: what the shell does first.
inline Outcome RunProgram(const std::string& arguments, const std::string& before = "") {
  Outcome outcome;
  std::FILE* pipe = ::popen((before + TILEGRAD_PROGRAM + " " + arguments + " 2>&1").c_str(), "r");
  std::array<char, 4096> buffer;
  for (std::size_t n; (n = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0;)
    outcome.output.append(buffer.data(), n);
  const int status = ::pclose(pipe);
  if (WIFEXITED(status)) outcome.exit_code = WEXITSTATUS(status);
  return outcome;
}

}  // namespace tilegrad
