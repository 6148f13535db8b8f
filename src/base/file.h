// SPDX-License-Identifier: Apache-2.0
// Whole files. A file that we write appears complete under its name or not at all, whatever happens
// in between.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tilegrad/status.h"

namespace tilegrad {

using Path = std::filesystem::path;
using Bytes = std::vector<std::uint8_t>;

// Errors name the path and the system's reason. A directory, or a file above `max_bytes`, is
// refused before reading.
Result<Bytes> ReadFile(const Path& path, std::size_t max_bytes = std::size_t{4} << 30);
Result<std::string> ReadText(const Path& path, std::size_t max_bytes = std::size_t{1} << 30);

// Writes to a temporary name beside `path`, fsyncs, renames over `path`, fsyncs the folder. On any
// failure (full disk, ...) the temporary is removed and what stood under `path` is untouched.
// Missing parent folders are created. Symbolic links stay, devices and pipes are written to.
Status WriteFileAtomic(const Path& path, std::span<const std::uint8_t> bytes);
Status WriteTextAtomic(const Path& path, std::string_view text);

// Appends and fsyncs if `durable`. A line that was cut by a crash is the reader's to detect.
Status AppendText(const Path& path, std::string_view text, bool durable);

// Whether a path leads to anything, a folder, a file; no where that cannot be found out.
bool PathExists(const Path& path);
bool IsFolder(const Path& path);
bool IsFile(const Path& path);

Status MakeFolder(const Path& path);  // with parents; existing is fine
// In this order; an error names the first that cannot be removed. What is not there is fine.
Status RemoveFiles(std::span<const Path> files);

}  // namespace tilegrad
