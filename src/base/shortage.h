// SPDX-License-Identifier: Apache-2.0
// What the system refuses for lack of resources: file handles, memory, processes. It says nothing
// of the file that was to be read, which must be called neither damaged nor missing.
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
// libraries call all that fails corrupt. Whoever calls them watches whether the process was refused
// something meanwhile; in another thread, too, which then only means that both try again.
class ShortageWatch {
 public:
  ShortageWatch();
  // An error, "place: the system refused ...", if there was a shortage since.
  Status Check(const std::string& place) const;

 private:
  std::uint64_t before_;
};

}  // namespace tilegrad
