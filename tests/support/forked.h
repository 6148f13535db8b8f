// SPDX-License-Identifier: Apache-2.0
// Tests in a child process.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>

#include "base/sanitizers.h"

namespace tilegrad::test {

// Why a forked child of a process with threads cannot start threads; null if it can.
// ThreadSanitizer ends such a child, and so does qemu-user, for which tests/cross sets the
// variable.
inline const char* WhyNoFork() {
  if (kThreadSanitizer) return "ThreadSanitizer allows no threads after a fork";
  return std::getenv("TILEGRAD_TEST_NO_FORK") == nullptr
             ? nullptr
             : "TILEGRAD_TEST_NO_FORK is set: the emulator allows no threads after a fork";
}

// Runs `call` in a child process, for at most 60 seconds; whether it returned true.
template <class Call>
bool TrueInChild(const Call& call) {
  const pid_t child = fork();
  if (child == 0) {
    alarm(60);
    _exit(call() ? 0 : 1);
  }
  int status = 0;
  return waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace tilegrad::test
