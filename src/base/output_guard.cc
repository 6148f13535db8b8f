// SPDX-License-Identifier: Apache-2.0
#include "base/output_guard.h"

#include <sys/stat.h>

#include <algorithm>
#include <optional>

#include "base/error.h"
#include "base/file.h"
#include "base/output_notes.h"

namespace tilegrad {
namespace {

constexpr const char* kLock = ".lock";  // base/folder_lock.h

std::optional<struct stat> Stat(const Path& path) {
  struct stat info = {};
  return ::stat(path.c_str(), &info) == 0 ? std::optional(info) : std::nullopt;
}

// The file itself, where the name is a symbolic link.
Path Target(const Path& path) {
  std::error_code error;
  const Path target = std::filesystem::canonical(path, error);
  return error ? path : target;
}

// Empty where the file cannot be read.
std::string Checksum(const Path& file) {
  const auto content = ReadFile(file, std::size_t{8} << 30);
  return content.ok() ? OutputChecksum(file, *content) : "";
}

}  // namespace

void OutputGuard::AddInput(const Path& path) {
  const auto info = Stat(path);
  if (!info) return;
  if (!S_ISDIR(info->st_mode)) {
    inputs_.insert({info->st_dev, info->st_ino});
    return;
  }
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(path, error)) {
    if (!entry.is_directory(error)) AddInput(entry.path());
  }
}

void OutputGuard::AddInputs(std::span<const Path> paths) {
  for (const Path& path : paths) AddInput(path);
}

OutputGuard::Notes& OutputGuard::NotesOf(const Path& folder) const {
  const auto [at, added] = notes_.try_emplace(folder);
  if (added) at->second = ReadOutputNotes(folder);
  return at->second;
}

LeftTemporaries& OutputGuard::LeftIn(const Path& folder) const {
  return left_.try_emplace(folder, folder.empty() ? Path(".") : folder).first->second;
}

bool OutputGuard::IsOurs(const Path& file) const {
  const Path target = Target(file);
  const std::string checksum = Checksum(target);
  return !checksum.empty() && NotesOf(target.parent_path()).contains(checksum);
}

Status OutputGuard::Check(const Path& file) const {
  const auto info = Stat(file);
  if (!info) ExpectOutput(file);
  if (!info || !S_ISREG(info->st_mode)) return {};  // writing to a folder is an error of its own
  if (inputs_.contains({info->st_dev, info->st_ino})) {
    return InvalidArgument("{}: is read here, so it is not written; choose another --out",
                           file.string());
  }
  if (force_ || IsOurs(file)) {
    ExpectOutput(file);
    return {};
  }
  return InvalidArgument(
      "{}: is there already and is not, as it stands, what tilegrad wrote; --force replaces it, or "
      "choose another --out",
      file.string());
}

Status OutputGuard::CheckAll(std::span<const Path> files) const {
  for (const Path& file : files) TILEGRAD_TRY(Check(file));
  return {};
}

std::optional<Path> OutputGuard::ForeignFile(const Path& folder) const {
  std::error_code error;
  if (PathExists(folder / kLock)) return std::nullopt;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    if (entry.path().filename() == kOutputNotes) continue;
    if (entry.is_directory(error) && !entry.is_symlink(error)) {
      if (auto below = ForeignFile(entry.path())) return below;
    } else if (!IsOurs(entry.path())) {
      return entry.path();
    }
  }
  return std::nullopt;
}

Status OutputGuard::CheckFolder(const Path& folder) const {
  if (force_) return {};
  const auto foreign = ForeignFile(folder);
  if (!foreign) return {};
  return InvalidArgument(
      "{}: is not empty: tilegrad did not write {}; choose another folder, or --force to work "
      "among "
      "what is there",
      folder.string(), foreign->string());
}

void OutputGuard::Note(const Path& file) const {
  const auto info = Stat(file);
  if (!info || !S_ISREG(info->st_mode)) return;
  const Path target = Target(file);
  LeftIn(target.parent_path()).RemoveOf(target.filename().string());
  const std::string checksum = Checksum(target);
  if (checksum.empty() || !NotesOf(target.parent_path()).insert(checksum).second) return;
  // What WriteFileAtomic wrote has its note already, and an error where the disk had no room for
  // it.
  static_cast<void>(AddOutputNote(target.parent_path(), checksum));
}

void OutputGuard::NoteAll(std::span<const Path> files) const {
  for (const Path& file : files) Note(file);
}

}  // namespace tilegrad
