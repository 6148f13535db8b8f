// SPDX-License-Identifier: Apache-2.0
#include "base/shortage.h"

#include <atomic>
#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace tilegrad {
namespace {

std::atomic<std::uint64_t> g_count = 0;
std::atomic<int> g_last = 0;

const char* Remedy(int error) {
  if (error == EMFILE) return "allow more open files (ulimit -n) or use fewer workers";
  if (error == ENFILE) return "close other programs' files or use fewer workers";
  if (error == EAGAIN) return "allow more processes (ulimit -u) or use fewer workers";
  return "allow more memory (ulimit -v, the container's limit) or use fewer workers";
}

}  // namespace

bool IsShortage(int error) {
  for (const int shortage : {EMFILE, ENFILE, ENOMEM, EAGAIN, ENOBUFS}) {
    if (error == shortage) return true;
  }
  return false;
}

void NoteShortage(int error) {
  if (!IsShortage(error)) return;
  g_last = error;
  ++g_count;
}

ShortageWatch::ShortageWatch() : before_(g_count) {}

Status ShortageWatch::Check(const std::string& place) const {
  if (g_count == before_) return {};
  const int error = g_last;
  return IoError("{}: not read, the system ran out of a resource: {}; {}", place,
                 std::strerror(error), Remedy(error));
}

}  // namespace tilegrad
