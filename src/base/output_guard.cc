// SPDX-License-Identifier: Apache-2.0
#include "base/output_guard.h"

#include <sys/stat.h>

#include <optional>

#include "base/error.h"

namespace tilegrad {
namespace {

std::optional<struct stat> Stat(const Path& path) {
  struct stat info = {};
  return ::stat(path.c_str(), &info) == 0 ? std::optional(info) : std::nullopt;
}

// Any file in a folder and below; ignores what a killed call left half-written.
std::optional<Path> AnyFile(const Path& folder) {
  std::error_code error;
  for (std::filesystem::recursive_directory_iterator at(folder, error), end; !error && at != end;
       at.increment(error)) {
    const bool file = at->is_symlink(error) || !at->is_directory(error);
    if (file && !IsTemporary(at->path())) return at->path();
  }
  return std::nullopt;
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

LeftTemporaries& OutputGuard::LeftIn(const Path& folder) const {
  return left_.try_emplace(folder, folder.empty() ? Path(".") : folder).first->second;
}

Status OutputGuard::Check(const Path& file) const {
  TILEGRAD_TRY(CheckNotRead({&file, 1}));
  const auto info = Stat(file);
  // Writing to a folder is a separate error.
  if (info && S_ISREG(info->st_mode) && !force_) {
    return InvalidArgument("{}: exists; --force replaces it, or choose another name",
                           file.string());
  }
  LeftIn(file.parent_path()).RemoveOf(file.filename().string());
  return {};
}

Status OutputGuard::CheckAll(std::span<const Path> files) const {
  for (const Path& file : files) TILEGRAD_TRY(Check(file));
  return {};
}

Status OutputGuard::CheckNotRead(std::span<const Path> files) const {
  for (const Path& file : files) {
    const auto info = Stat(file);
    if (info && S_ISREG(info->st_mode) && inputs_.contains({info->st_dev, info->st_ino})) {
      return InvalidArgument(
          "{}: is an input of this command and is not overwritten; choose another --out",
          file.string());
    }
  }
  return {};
}

Status OutputGuard::CheckFolder(const Path& folder) const {
  if (force_) return {};
  const auto file = AnyFile(folder);
  if (!file) return {};
  return InvalidArgument("{}: is not empty ({}); choose another folder, or add to it with --force",
                         folder.string(), file->string());
}

}  // namespace tilegrad
