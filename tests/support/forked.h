// SPDX-License-Identifier: Apache-2.0
// Tests in a child process.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

namespace tilegrad::test {

// ThreadSanitizer ends a child that starts threads if its parent had some.
#ifdef __SANITIZE_THREAD__
inline constexpr bool kCanFork = false;
#else
inline constexpr bool kCanFork = true;
#endif
inline constexpr char kNoFork[] = "ThreadSanitizer allows no threads after a fork";

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
