// SPDX-License-Identifier: Apache-2.0
#include "base/output_notes.h"

#include <fcntl.h>
#include <unistd.h>

#include <mutex>
#include <sstream>

#include "base/hash.h"

namespace tilegrad {
namespace {

constexpr const char* kHead =
    "# Checksums of files that tilegrad wrote into this folder; it replaces these without asking.\n"
    "# Without this file, it asks for --force.\n";

// One write, so that several processes may do this at once. A link under that name, which others
// can make in a folder that is open to all, is not followed.
void Append(const Path& notes, const std::string& line) {
  std::error_code error;
  const bool fresh = !std::filesystem::exists(notes, error);
  const int fd =
      ::open(notes.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0644);
  if (fd < 0) return;
  const std::string text = (fresh ? kHead : "") + line + "\n";
  [[maybe_unused]] const ssize_t written = ::write(fd, text.data(), text.size());
  ::close(fd);
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

void AddOutputNote(const Path& folder, const std::string& checksum) {
  if (!ReadOutputNotes(folder).contains(checksum)) Append(folder / kOutputNotes, checksum);
}

void ExpectOutput(const Path& file) {
  const Path path = Absolute(file);
  const std::lock_guard lock(ExpectedOutputs().mutex);
  ExpectedOutputs().files.insert(path);
}

void NoteIfExpected(const Path& file, std::span<const std::uint8_t> content) {
  const Path path = Absolute(file);
  const std::lock_guard lock(ExpectedOutputs().mutex);
  if (!ExpectedOutputs().files.contains(path)) return;
  AddOutputNote(path.parent_path(), OutputChecksum(path, content));
}

}  // namespace tilegrad
