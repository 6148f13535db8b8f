// SPDX-License-Identifier: Apache-2.0
#include "base/output_notes.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <mutex>
#include <sstream>

#include "base/error.h"
#include "base/file.h"
#include "base/hash.h"
#include "base/shortage.h"

namespace tilegrad {
namespace {

constexpr const char* kHead =
    "# Checksums of files that tilegrad wrote into this folder; it replaces these without asking.\n"
    "# Without this file, it asks for --force.\n";

bool EndsInTheMiddle(int fd) {
  const off_t size = ::lseek(fd, 0, SEEK_END);
  char last = '\n';
  return size > 0 && ::pread(fd, &last, 1, size - 1) == 1 && last != '\n';
}

Status NoRoom(const Path& notes, int error) {
  NoteShortage(error);
  return IoError("{}: cannot append: {}", notes.string(), std::strerror(error));
}

// One write, so that several processes may do this at once. A link under that name, which others
// can make in a folder that is open to all, is not followed.
Status Append(const Path& notes, const std::string& line) {
  const bool fresh = !PathExists(notes);
  const int fd = ::open(notes.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0644);
  if (fd < 0) return errno == ENOSPC || errno == EDQUOT ? NoRoom(notes, errno) : Status();
  // A disk that was full left a part of a line.
  const std::string text = (fresh ? kHead : EndsInTheMiddle(fd) ? "\n" : "") + line + "\n";
  errno = 0;
  const ssize_t written = ::write(fd, text.data(), text.size());
  const int failed = written < 0 ? errno : ENOSPC;
  ::close(fd);
  return written == static_cast<ssize_t>(text.size()) ? Status() : NoRoom(notes, failed);
}

struct Expected {
  std::mutex mutex;
  std::set<Path> files;
};

Expected& ExpectedOutputs() {
  static Expected expected;
  return expected;
}

Path Absolute(const Path& file) {
  std::error_code error;
  const Path path = std::filesystem::weakly_canonical(std::filesystem::absolute(file), error);
  return error ? file : path;
}

}  // namespace

std::string OutputChecksum(const Path& file, std::span<const std::uint8_t> content) {
  Hash hash;
  hash.Add(file.filename().string());
  hash.Add(std::string_view(reinterpret_cast<const char*>(content.data()), content.size()));
  return hash.Text();
}

std::set<std::string> ReadOutputNotes(const Path& folder) {
  std::set<std::string> out;
  const auto text = ReadText(folder / kOutputNotes);
  if (!text.ok()) return out;
  std::istringstream lines(*text);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with('#')) out.insert(line);
  }
  return out;
}

Status AddOutputNote(const Path& folder, const std::string& checksum) {
  if (ReadOutputNotes(folder).contains(checksum)) return {};
  return Append(folder / kOutputNotes, checksum);
}

void ExpectOutput(const Path& file) {
  const Path path = Absolute(file);
  const std::lock_guard lock(ExpectedOutputs().mutex);
  ExpectedOutputs().files.insert(path);
}

Status NoteIfExpected(const Path& file, std::span<const std::uint8_t> content) {
  const Path path = Absolute(file);
  const std::lock_guard lock(ExpectedOutputs().mutex);
  if (!ExpectedOutputs().files.contains(path)) return {};
  return AddOutputNote(path.parent_path(), OutputChecksum(path, content));
}

}  // namespace tilegrad
