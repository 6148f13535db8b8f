// SPDX-License-Identifier: Apache-2.0
// The notes behind base/output_guard.h: `.tilegrad-made` of a folder. A checksum is noted before
// its file takes its name, so that a process which is killed right then leaves no file that the
// next one would take for somebody else's.
#pragma once

#include <cstdint>
#include <set>
#include <span>
#include <string>

#include "base/file.h"

namespace tilegrad {

inline constexpr const char* kOutputNotes = ".tilegrad-made";

// Of the name without its folder and the content.
std::string OutputChecksum(const Path& file, std::span<const std::uint8_t> content);
std::set<std::string> ReadOutputNotes(const Path& folder);
// Unless it is there. Where no note may be made (somebody else's folder), there is none; an error
// is one that the disk has no room for.
Status AddOutputNote(const Path& folder, const std::string& checksum);

// Files that this process may write for a user: WriteFileAtomic() notes them. Any thread.
void ExpectOutput(const Path& file);
Status NoteIfExpected(const Path& file, std::span<const std::uint8_t> content);

}  // namespace tilegrad
