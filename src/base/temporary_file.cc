// SPDX-License-Identifier: Apache-2.0
#include "base/temporary_file.h"

#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <climits>
#include <csignal>
#include <optional>

#include "base/error.h"
#include "base/hash.h"

namespace tilegrad {
namespace {

constexpr const char* kEnding = ".tmp";

// The process that TemporaryOf() named a file after.
std::optional<pid_t> WriterOf(const Path& file) {
  if (file.extension() != kEnding) return std::nullopt;
  const std::string number = file.stem().extension().string();  // ".123"
  if (number.size() < 2) return std::nullopt;
  pid_t writer = 0;
  const char* end = number.data() + number.size();
  const auto [at, error] = std::from_chars(number.data() + 1, end, writer);
  return error == std::errc() && at == end && writer > 0 ? std::optional(writer) : std::nullopt;
}

// A file with our own number is from an earlier process: in a container every run may get it.
bool IsRunningElsewhere(pid_t writer) {
  return writer != ::getpid() && (::kill(writer, 0) == 0 || errno == EPERM);
}

}  // namespace

Path TemporaryOf(const Path& path) {
  const std::string ending = fmt::format(".{}{}", ::getpid(), kEnding);
  std::string name = path.filename().string();
  if (name.size() + ending.size() > NAME_MAX) {
    Hash hash;
    hash.Add(name);
    name = hash.Text();
  }
  return path.parent_path() / (name + ending);
}

bool IsTemporary(const Path& file) { return WriterOf(file).has_value(); }

LeftTemporaries::LeftTemporaries(const Path& folder) {
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::optional<pid_t> writer = WriterOf(entry.path());
    if (!writer || IsRunningElsewhere(*writer) || !entry.is_regular_file(error)) continue;
    files_.emplace(entry.path().stem().stem().string(), entry.path());
  }
}

void LeftTemporaries::RemoveAll() {
  std::error_code error;
  for (const auto& [_, file] : files_) std::filesystem::remove(file, error);
  files_.clear();
}

void LeftTemporaries::RemoveOf(const std::string& name) {
  std::error_code error;
  const std::string short_name = TemporaryOf(name).stem().stem().string();
  const auto [first, end] = files_.equal_range(short_name);
  for (auto at = first; at != end; ++at) std::filesystem::remove(at->second, error);
  files_.erase(first, end);
}

void RemoveTemporaries(const Path& folder) { LeftTemporaries(folder).RemoveAll(); }

void RemoveTemporariesOf(const Path& file) {
  const Path folder = file.parent_path();
  LeftTemporaries(folder.empty() ? Path(".") : folder).RemoveOf(file.filename().string());
}

}  // namespace tilegrad
