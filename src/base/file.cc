// SPDX-License-Identifier: Apache-2.0
#include "base/file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <climits>
#include <csignal>
#include <cstring>
#include <optional>

#include "base/error.h"
#include "base/hash.h"
#include "base/read_budget.h"

namespace tilegrad {
namespace {

// Closes on scope exit; close(2) errors matter only when writing, where Close() is called and
// checked.
class FileHandle {
 public:
  FileHandle(const Path& path, int flags) : fd_(::open(path.c_str(), flags | O_CLOEXEC, 0644)) {}
  ~FileHandle() {
    if (fd_ >= 0) ::close(fd_);
  }
  FileHandle(const FileHandle&) = delete;
  FileHandle& operator=(const FileHandle&) = delete;
  int fd() const { return fd_; }
  bool Close() { return ::close(std::exchange(fd_, -1)) == 0; }

 private:
  int fd_;
};

Status SystemError(const Path& path, const char* doing) {
  NoteShortage(errno);
  return {StatusCode::kIo, fmt::format("{}: {}: {}", path.string(), doing, std::strerror(errno))};
}

// kNotFound for a missing file, or a path through something that is no folder.
Status CannotOpenToRead(const Path& path) {
  const bool missing = errno == ENOENT || errno == ENOTDIR;
  const Status status = SystemError(path, "cannot open");
  return missing ? Status(StatusCode::kNotFound, status.message()) : status;
}

bool WriteAll(int fd, std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
  return true;
}

std::span<const std::uint8_t> AsBytes(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

Status SyncFolder(const Path& folder) {
  FileHandle handle(folder.empty() ? Path(".") : folder, O_RDONLY | O_DIRECTORY);
  if (handle.fd() < 0 || ::fsync(handle.fd()) != 0)
    return SystemError(folder, "cannot sync the folder");
  return {};
}

// Errors name `path`, which the caller knows.
Status WriteTemporary(const Path& temporary, const Path& path, BytePieces pieces) {
  FileHandle file(temporary, O_WRONLY | O_CREAT | O_TRUNC);
  if (file.fd() < 0) return SystemError(path, "cannot create");
  for (const auto& piece : pieces) {
    if (!WriteAll(file.fd(), piece)) return SystemError(path, "cannot write");
  }
  if (::fsync(file.fd()) != 0) return SystemError(path, "cannot sync");
  if (!file.Close()) return SystemError(path, "cannot close");
  return {};
}

template <class Container>
Result<Container> ReadWhole(const Path& path, std::size_t max_bytes) {
  FileHandle file(path, O_RDONLY | O_NONBLOCK);  // opening a pipe must not wait for a writer
  if (file.fd() < 0) return CannotOpenToRead(path);
  struct stat info = {};
  if (::fstat(file.fd(), &info) != 0) return SystemError(path, "cannot stat");
  if (!S_ISREG(info.st_mode)) return InvalidArgument("{}: not a regular file", path.string());
  const auto size = static_cast<std::size_t>(info.st_size);
  if (size > max_bytes) {
    return ResourceExhausted("{}: {} bytes, more than the limit of {}", path.string(), size,
                             max_bytes);
  }
  TILEGRAD_TRY(ReadBudget::Take(size, path.string()));
  Container out(size, typename Container::value_type{});
  std::size_t done = 0;
  while (done < size) {
    const ssize_t n = ::read(file.fd(), out.data() + done, size - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return SystemError(path, "cannot read");
    if (n == 0) return DataLoss("{}: ended after {} of {} bytes", path.string(), done, size);
    done += static_cast<std::size_t>(n);
  }
  return out;
}

// Terminals, pipes, /dev/null: a rename would replace them by a file.
bool IsDevice(const Path& path) {
  struct stat info = {};
  return ::stat(path.c_str(), &info) == 0 && !S_ISREG(info.st_mode) && !S_ISDIR(info.st_mode);
}

Status WriteToDevice(const Path& path, BytePieces pieces) {
  FileHandle file(path, O_WRONLY);
  if (file.fd() < 0) return SystemError(path, "cannot open");
  for (const auto& piece : pieces) {
    if (!WriteAll(file.fd(), piece)) return SystemError(path, "cannot write");
  }
  if (!file.Close()) return SystemError(path, "cannot close");
  return {};
}

// The target of a symbolic link; `path` itself if it is none or dangles.
Path BehindLinks(const Path& path) {
  std::error_code error;
  if (!std::filesystem::is_symlink(path, error)) return path;
  Path target = std::filesystem::canonical(path, error);
  return error ? path : target;
}

constexpr const char* kEnding = ".tmp";

// The process in a name made by TemporaryOf().
std::optional<pid_t> WriterOf(const Path& file) {
  if (file.extension() != kEnding) return std::nullopt;
  const std::string number = file.stem().extension().string();  // ".123"
  if (number.size() < 2) return std::nullopt;
  pid_t writer = 0;
  const char* end = number.data() + number.size();
  const auto [at, error] = std::from_chars(number.data() + 1, end, writer);
  return error == std::errc() && at == end && writer > 0 ? std::optional(writer) : std::nullopt;
}

// A file with our own process id is from an earlier process: in a container every run may get the
// same.
bool IsRunningElsewhere(pid_t writer) {
  return writer != ::getpid() && (::kill(writer, 0) == 0 || errno == EPERM);
}

constexpr int kAttempts = 2;
constexpr unsigned kPauseMicroseconds = 10'000;

}  // namespace

Result<Bytes> ReadFile(const Path& path, std::size_t max_bytes) {
  return ReadWhole<Bytes>(path, max_bytes);
}

Result<std::string> ReadText(const Path& path, std::size_t max_bytes) {
  return ReadWhole<std::string>(path, max_bytes);
}

Status WriteFileAtomic(const Path& path, std::span<const std::uint8_t> bytes) {
  return WriteFileAtomic(path, BytePieces(&bytes, 1));
}

Status WriteFileAtomic(const Path& path_or_link, BytePieces pieces) {
  if (IsDevice(path_or_link)) return WriteToDevice(path_or_link, pieces);
  const Path path = BehindLinks(path_or_link);
  if (path.has_parent_path()) TILEGRAD_TRY(MakeFolder(path.parent_path()));
  const Path temporary = TemporaryOf(path);
  Status status = WriteTemporary(temporary, path, pieces);
  if (status.ok() && ::rename(temporary.c_str(), path.c_str()) != 0) {
    status = SystemError(path, "cannot be replaced");
  }
  if (!status.ok()) {
    ::unlink(temporary.c_str());
    return status;
  }
  return SyncFolder(path.parent_path());
}

Status WriteTextAtomic(const Path& path, std::string_view text) {
  return WriteFileAtomic(path, AsBytes(text));
}

Status AppendText(const Path& path, std::string_view text, bool durable) {
  FileHandle file(path, O_WRONLY | O_CREAT | O_APPEND);
  if (file.fd() < 0) return SystemError(path, "cannot open");
  if (!WriteAll(file.fd(), AsBytes(text))) return SystemError(path, "cannot append");
  if (durable && ::fsync(file.fd()) != 0) return SystemError(path, "cannot sync");
  if (!file.Close()) return SystemError(path, "cannot close");
  return {};
}

bool PathExists(const Path& path) {
  std::error_code error;
  return std::filesystem::exists(path, error);
}

bool IsFolder(const Path& path) {
  std::error_code error;
  return std::filesystem::is_directory(path, error);
}

bool IsFile(const Path& path) {
  std::error_code error;
  return std::filesystem::is_regular_file(path, error);
}

Status MakeFolder(const Path& path) {
  if (path.empty()) return InvalidArgument("the folder has no name");
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) return IoError("{}: cannot create the folder: {}", path.string(), error.message());
  return {};
}

Status RemoveFiles(std::span<const Path> files) {
  for (const Path& file : files) {
    std::error_code error;
    std::filesystem::remove(file, error);
    if (error) return IoError("{}: cannot be removed: {}", file.string(), error.message());
  }
  return {};
}

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

FolderLock::FolderLock(const Path& folder)
    : fd_(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {}

FolderLock::~FolderLock() {
  if (fd_ >= 0) ::close(fd_);
}

Result<FolderLock> FolderLock::Take(const Path& folder) {
  TILEGRAD_TRY(MakeFolder(folder));
  FolderLock lock(folder);
  if (lock.fd_ < 0) return IoError("{}: cannot open: {}", folder.string(), std::strerror(errno));
  // IsHeld takes the lock for a moment, so retry.
  for (int attempt = 0; ::flock(lock.fd_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
       ++attempt) {
    if (attempt == kAttempts)
      return InvalidArgument("{}: in use by another process", folder.string());
    ::usleep(kPauseMicroseconds);
  }
  return lock;
}

bool FolderLock::IsHeld(const Path& folder) {
  const FolderLock probe(folder);
  return probe.fd_ >= 0 && ::flock(probe.fd_, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
}

}  // namespace tilegrad
