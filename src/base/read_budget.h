// SPDX-License-Identifier: Apache-2.0
// How many bytes one file may become in memory, with all files that it names and all that is packed
// in it: a megabyte of a GLB can hold pictures of gigabytes. Decoders ask before they allocate.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "tilegrad/status.h"

namespace tilegrad {

// Names the limit in the environment.
inline constexpr const char* kReadLimitVariable = "TILEGRAD_READ_LIMIT";

// The bytes of "4294967296", "500M" or "16G", with any of K, M, G, T as powers of 1024. Fails for
// 0, other text and what is too large.
Result<std::size_t> ParseByteCount(const std::string& text);

// 4 GiB, or what kReadLimitVariable says. An error if that is no number of bytes.
Result<std::size_t> ReadLimit();

// The budget of whatever this thread reads while the object lives. Inside of another one it is a
// part of that: a side file belongs to the file.
class ReadBudget {
 public:
  ReadBudget();  // of ReadLimit()
  explicit ReadBudget(std::size_t bytes);
  ~ReadBudget();
  ReadBudget(const ReadBudget&) = delete;
  ReadBudget& operator=(const ReadBudget&) = delete;

  // `bytes` more, for `what` (a file, an image): an error that names it and says how to allow more.
  // OK where this thread has no budget.
  static Status Take(std::size_t bytes, const std::string& what);
  // The first error of Take: who goes on without what was refused returns it in the end.
  Status status() const;

 private:
  ReadBudget* outer_;
  Result<std::size_t> limit_;
  std::size_t taken_ = 0;
  Status refused_;
};

// Refusals of the system for lack of resources: file handles, memory, processes. They say nothing
// about the file being read, which must be reported neither as damaged nor as missing.

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
