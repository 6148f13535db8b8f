// SPDX-License-Identifier: Apache-2.0
// Runs a function that may crash, hang or exhaust memory in a child process, which returns bytes.
//
// The child is a fork without exec of a process that may have other threads, which do not exist in
// it: the function must not use Workers, nor any lock that another thread may have held at the fork
// (of an archive, of stdio, ...). Allocating is fine. It asks the parent for anything that is not
// in its memory.
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

#include "base/file.h"
#include "base/function_ref.h"
#include "base/progress.h"

namespace tilegrad::io {

struct GuardLimits {
  int cpu_seconds = 20;       // CPU time of the child
  double wall_seconds = 120;  // for waiting without computing; generous: machines are busy
  std::size_t memory_bytes = std::size_t{2} << 30;  // beyond the parent's own, and of the result;
                                                    // the former is off under sanitizers
};

// Asks the parent a question; nullopt if it has no answer.
using AskParent = FunctionRef<std::optional<Bytes>(std::string_view question)>;
// Runs in the child. An exception that escapes is an error of RunGuarded.
using ChildFunction = FunctionRef<Bytes(AskParent ask)>;
// Runs in the parent, in the calling thread. The question is untrusted bytes.
using AnswerFunction = FunctionRef<std::optional<Bytes>(std::string_view question)>;

// Returns what `run` returned, which is untrusted: a misbehaving function may return anything.
// Errors continue a sentence whose subject is the task of `run`: "crashed (Segmentation fault)",
// "took more than 20 s of processor time". Whatever happens, the child has ended on return, and its
// changes to memory, descriptors, signals or output have no effect. Thread-safe.
Result<Bytes> RunGuarded(ChildFunction run, AnswerFunction answer, const GuardLimits& limits);

// While *stop is set, every RunGuarded of this process kills its child within a tenth of a second
// and returns kCancelled, and so do the mesh readers. For programs that catch signals; null, the
// default: no flag.
void StopGuardedBy(const StopFlag* stop);
bool GuardedMustStop();

}  // namespace tilegrad::io
