// SPDX-License-Identifier: Apache-2.0
// The program itself, as a person starts it.
#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <string>

#include "support/temp_folder.h"

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

// A fixture that calls the program, with a folder of its own.
class ProgramTest : public TempFolderTest {
 protected:
  std::string In(const std::string& name) const { return (folder_ / name).string(); }
  bool Exists(const std::string& name) const { return PathExists(folder_ / name); }

  // What it says.
  static std::string ExpectDone(const std::string& arguments, const std::string& before = "") {
    const Outcome outcome = RunProgram(arguments, before);
    EXPECT_EQ(outcome.exit_code, 0) << arguments << "\n" << outcome.output;
    return outcome.output;
  }
  // It says all of these.
  template <class... Parts>
  static void ExpectRefused(const std::string& arguments, int code, const Parts&... parts) {
    const Outcome outcome = RunProgram(arguments);
    EXPECT_EQ(outcome.exit_code, code) << arguments << "\n" << outcome.output;
    for (const std::string& part : {std::string(parts)...})
      EXPECT_NE(outcome.output.find(part), std::string::npos)
          << "\"" << part << "\" is not in: " << outcome.output;
  }
};

}  // namespace tilegrad
