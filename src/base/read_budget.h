// SPDX-License-Identifier: Apache-2.0
// Limits the memory that reading one file may take, including all files it names and all that is
// compressed in it: a megabyte of GLB can hold gigabytes of pictures. Decoders ask before they
// allocate.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "tilegrad/status.h"

namespace tilegrad {

// The environment variable that sets the limit.
inline constexpr const char* kReadLimitVariable = "TILEGRAD_READ_LIMIT";

// Parses "4294967296", "500M" or "16G", with K, M, G, T as powers of 1024. Fails for 0, other text
// and numbers that are too large.
Result<std::size_t> ParseByteCount(const std::string& text);

// kReadLimitVariable, or 4 GiB if unset. An error if that is no number of bytes.
Result<std::size_t> ReadLimit();

// The budget of everything this thread reads during its lifetime. Inside another budget only the
// outermost counts: a side file belongs to the file.
class ReadBudget {
 public:
  ReadBudget();  // with ReadLimit()
  explicit ReadBudget(std::size_t bytes);
  ~ReadBudget();
  ReadBudget(const ReadBudget&) = delete;
  ReadBudget& operator=(const ReadBudget&) = delete;

  // Takes `bytes` for `what` (a file, an image); an error names it and says how to raise the limit.
  // OK if this thread has no budget.
  static Status Take(std::size_t bytes, const std::string& what);
  // The first error of Take: a reader that continues without the refused part returns it at the
  // end.
  Status status() const;

 private:
  ReadBudget* outer_;
  Result<std::size_t> limit_;
  std::size_t taken_ = 0;
  Status refused_;
};

// Resource shortages: the system refuses file handles, memory or processes. They say nothing about
// the file being read, so it must be reported neither as damaged nor as missing.

// Whether an errno is such a shortage.
bool IsShortage(int error);
// Records it for watches if it is one. Thread-safe.
void NoteShortage(int error);

// Readers substitute for what they cannot get (a texture, a material library), and libraries report
// every failure as corruption. So callers watch for shortages meanwhile; one in
// another thread merely makes both retry.
class ShortageWatch {
 public:
  ShortageWatch();
  // An error, "place: the system refused ...", if there was a shortage since construction.
  Status Check(const std::string& place) const;

 private:
  std::uint64_t before_;
};

}  // namespace tilegrad
