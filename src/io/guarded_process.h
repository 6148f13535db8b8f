// SPDX-License-Identifier: Apache-2.0
// Runs a function that may crash, hang or exhaust memory in a child process, and gets bytes back.
//
// The child is a fork without exec of a process that may have other threads, none of which exist
// in it: the function must not use Workers, nor any lock that another thread may have held at that
// moment (of an archive, of stdio, ...). Allocating is fine. What it needs of the parent beyond the
// memory it was born with, it asks for.
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

#include "base/file.h"
#include "base/function_ref.h"
#include "base/progress.h"

namespace tilegrad::io {

struct GuardLimits {
  int cpu_seconds = 20;       // processor time of the child
  double wall_seconds = 120;  // for what waits without computing; generous: machines are busy
  std::size_t memory_bytes = std::size_t{2} << 30;  // beyond the parent's own, and of the result;
                                                    // the former not under sanitizers
};

// The child's way to ask; nothing if the parent has no answer.
using AskParent = FunctionRef<std::optional<Bytes>(std::string_view question)>;
// Runs in the child. An exception that leaves it is an error of RunGuarded.
using ChildFunction = FunctionRef<Bytes(AskParent ask)>;
// Runs in the parent, in the calling thread. The question is untrusted: of any bytes.
using AnswerFunction = FunctionRef<std::optional<Bytes>(std::string_view question)>;

// The bytes that `run` returned, which are untrusted: a function that went wrong may return
// anything. Errors complete a sentence that begins with what `run` is: "crashed (Segmentation
// fault)", "took more than 20 s of processor time". Whatever happens, the child is gone afterwards
// and nothing that it did to memory, descriptors, signals or output is seen. Thread-safe.
Result<Bytes> RunGuarded(ChildFunction run, AnswerFunction answer, const GuardLimits& limits);

// While *stop is set, every RunGuarded of this process ends its child within a tenth of a second
// and returns kCancelled, and so do the readers of mesh files. For programs that catch signals;
// null: none, as at the start.
void StopGuardedBy(const StopFlag* stop);
bool GuardedMustStop();

}  // namespace tilegrad::io
