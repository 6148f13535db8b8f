// SPDX-License-Identifier: Apache-2.0
// Refusals of the system for lack of resources: file handles, memory, processes. They say nothing
// about the file being read, which must be reported neither as damaged nor as missing.
#pragma once

#include <cstdint>
#include <string>

#include "tilegrad/status.h"

namespace tilegrad {

// Whether an errno is such a refusal.
bool IsShortage(int error);
// Remembers it, for watches, if it is one. Thread-safe.
void NoteShortage(int error);

// Readers put substitutes in place of what they cannot get (a texture, a material library), and
// libraries call all that fails corrupt. Their callers watch for a refusal in the meantime; one
// in another thread only makes both try again.
class ShortageWatch {
 public:
  ShortageWatch();
  // An error, "place: the system refused ...", if there was a shortage since.
  Status Check(const std::string& place) const;

 private:
  std::uint64_t before_;
};

}  // namespace tilegrad
