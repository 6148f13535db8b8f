// SPDX-License-Identifier: Apache-2.0
#include "io/archive.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zip.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>
#include <mutex>

#include "base/error.h"
#include "base/hash.h"
#include "base/read_budget.h"
#include "base/text.h"

namespace tilegrad::io {
namespace {

constexpr zip_uint64_t kMaxEntryBytes = zip_uint64_t{4} << 30;

// Finds a file below `folder`, ignoring case component by component.
std::optional<Path> FindIgnoringCase(const Path& folder, const std::string& name) {
  if (Path exact = folder / name; PathExists(exact)) return exact;
  Path at = folder;
  for (const Path& part : Path(name)) {
    std::error_code error;
    if (PathExists(at / part)) {
      at /= part;
      continue;
    }
    const std::string wanted = LowerCase(part.string());
    std::optional<Path> found;
    for (const auto& entry : std::filesystem::directory_iterator(at, error)) {
      if (LowerCase(entry.path().filename().string()) == wanted) found = entry.path();
    }
    NoteShortage(error.value());
    if (!found) return std::nullopt;
    at = *found;
  }
  return at;
}

class Folder : public FileSource {
 public:
  Folder(Path path, std::vector<Path>* read) : path_(std::move(path)), read_(read) {}
  Result<Bytes> Read(const std::string& name) const override {
    const auto found = Find(name);
    if (!found) return NotFound("{}: no such file", Describe(name));
    if (read_ != nullptr) read_->push_back(*found);
    return ReadFile(*found);
  }
  bool Exists(const std::string& name) const override {
    const auto found = Find(name);
    return found && IsFile(*found);
  }
  std::string Describe(const std::string& name) const override { return (path_ / name).string(); }

 private:
  std::optional<Path> Find(const std::string& name) const {
    const auto normal = NormalizeName(name);
    return normal ? FindIgnoringCase(path_, *normal) : std::nullopt;
  }
  Path path_;
  std::vector<Path>* read_;
};

struct ZipCloser {
  void operator()(zip_t* zip) const { zip_discard(zip); }
};
using ZipHandle = std::unique_ptr<zip_t, ZipCloser>;

// Refuses files for which libzip would block (a pipe without a writer) or report a damaged archive.
Status CheckRegularFile(const Path& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (file < 0 && errno == ENOENT) return {};
  if (file < 0) {
    NoteShortage(errno);
    return IoError("{}: cannot open: {}", path.string(), std::strerror(errno));
  }
  struct stat info = {};
  const bool regular = ::fstat(file, &info) == 0 && S_ISREG(info.st_mode);
  ::close(file);
  return regular ? Status() : InvalidArgument("{}: not a regular file", path.string());
}

Result<ZipHandle> OpenZipHandle(const Path& path) {
  TILEGRAD_TRY(CheckRegularFile(path));
  int code = 0;
  ZipHandle zip(zip_open(path.c_str(), ZIP_RDONLY | ZIP_CHECKCONS, &code));
  if (zip) return zip;
  const int system = code == ZIP_ER_MEMORY ? ENOMEM : errno;
  if (code == ZIP_ER_NOENT) return NotFound("{}: no such file", path.string());
  if (code == ZIP_ER_MEMORY || code == ZIP_ER_OPEN || code == ZIP_ER_READ) {  // not its fault
    NoteShortage(system);
    return IoError("{}: cannot be read: {}", path.string(), std::strerror(system));
  }
  zip_error_t error;
  zip_error_init_with_code(&error, code);
  const Status status = DataLoss("{}: not a zip archive that can be read: {}", path.string(),
                                 zip_error_strerror(&error));
  zip_error_fini(&error);
  return status;
}

class Zip : public FileSource {
 public:
  Zip(Path path, ZipHandle zip) : path_(std::move(path)), zip_(std::move(zip)) {
    const zip_int64_t count = zip_get_num_entries(zip_.get(), 0);
    for (zip_int64_t i = 0; i < count; ++i) {
      const char* name = zip_get_name(zip_.get(), static_cast<zip_uint64_t>(i), 0);
      if (name != nullptr)
        by_lower_name_.try_emplace(LowerCase(name), static_cast<zip_uint64_t>(i));
    }
  }

  Result<Bytes> Read(const std::string& name) const override {
    const std::scoped_lock lock(mutex_);
    const auto index = Find(name);
    if (!index) return NotFound("{}: no such entry", Describe(name));
    zip_stat_t info;
    if (zip_stat_index(zip_.get(), *index, 0, &info) != 0 || !(info.valid & ZIP_STAT_SIZE))
      return DataLoss("{}: the entry has no size", Describe(name));
    if (info.size > kMaxEntryBytes) {
      return ResourceExhausted("{}: {} bytes unpacked, more than the limit of {}", Describe(name),
                               info.size, kMaxEntryBytes);
    }
    TILEGRAD_TRY(ReadBudget::Take(info.size, Describe(name)));
    return ReadEntry(name, *index, info.size);
  }
  bool Exists(const std::string& name) const override {
    const std::scoped_lock lock(mutex_);
    return Find(name).has_value();
  }
  std::string Describe(const std::string& name) const override {
    return path_.string() + ": " + name;
  }

 private:
  std::optional<zip_uint64_t> Find(const std::string& name) const {
    const auto normal = NormalizeName(name);
    if (!normal) return std::nullopt;
    const zip_int64_t exact = zip_name_locate(zip_.get(), normal->c_str(), 0);
    if (exact >= 0) return static_cast<zip_uint64_t>(exact);
    const auto it = by_lower_name_.find(LowerCase(*normal));
    return it == by_lower_name_.end() ? std::nullopt : std::optional(it->second);
  }

  Status CannotOpen(const std::string& name) const {
    const bool memory = zip_error_code_zip(zip_get_error(zip_.get())) == ZIP_ER_MEMORY;
    if (memory) NoteShortage(ENOMEM);
    const std::string message = Describe(name) + ": " + zip_strerror(zip_.get());
    return {memory ? StatusCode::kIo : StatusCode::kDataLoss, message};
  }

  Result<Bytes> ReadEntry(const std::string& name, zip_uint64_t index, zip_uint64_t size) const {
    const std::unique_ptr<zip_file_t, decltype(&zip_fclose)> file(
        zip_fopen_index(zip_.get(), index, 0), &zip_fclose);
    if (!file) return CannotOpen(name);
    // Grows as data arrives: a header with a false size costs no memory.
    Bytes out;
    constexpr std::size_t kChunk = std::size_t{1} << 20;
    while (out.size() < size) {
      const std::size_t at = out.size();
      out.resize(at + std::min<std::size_t>(kChunk, size - at));
      const zip_int64_t got = zip_fread(file.get(), out.data() + at, out.size() - at);
      if (got <= 0)
        return DataLoss("{}: truncated or corrupt after {} of {} bytes", Describe(name), at, size);
      out.resize(at + static_cast<std::size_t>(got));
    }
    // Reading past the end makes libzip compare the checksum.
    std::uint8_t beyond = 0;
    if (zip_fread(file.get(), &beyond, 1) != 0)
      return DataLoss("{}: the checksum does not match", Describe(name));
    return out;
  }

  Path path_;
  ZipHandle zip_;
  std::map<std::string, zip_uint64_t> by_lower_name_;
  mutable std::mutex mutex_;
};

Status AddEntry(zip_t* zip, const std::string& name, const Bytes& bytes) {
  zip_source_t* source = zip_source_buffer(zip, bytes.data(), bytes.size(), 0);
  if (source == nullptr) return InternalError("zip: {}", zip_strerror(zip));
  const zip_int64_t index = zip_file_add(zip, name.c_str(), source, ZIP_FL_ENC_UTF_8);
  if (index < 0) {
    zip_source_free(source);
    return InternalError("zip: {}: {}", name, zip_strerror(zip));
  }
  // A fixed date, so that the same content gives the same file; level 1: renders are flat, higher
  // levels gain little.
  if (zip_file_set_dostime(zip, static_cast<zip_uint64_t>(index), 0, (1 << 5) | 1, 0) != 0 ||
      zip_set_file_compression(zip, static_cast<zip_uint64_t>(index), ZIP_CM_DEFLATE, 1) != 0) {
    return InternalError("zip: {}: {}", name, zip_strerror(zip));
  }
  return {};
}

// libzip writes into a growing memory buffer, which is then written out atomically.
Result<Bytes> EncodeZip(const std::vector<std::pair<std::string, Bytes>>& entries) {
  zip_error_t error;
  zip_error_init(&error);
  zip_source_t* source = zip_source_buffer_create(nullptr, 0, 0, &error);
  if (source == nullptr) return InternalError("zip: out of memory");
  zip_source_keep(source);
  const std::unique_ptr<zip_source_t, decltype(&zip_source_free)> keeper(source, &zip_source_free);
  ZipHandle zip(zip_open_from_source(source, ZIP_TRUNCATE, &error));
  if (!zip) {
    zip_source_free(source);
    return InternalError("zip: {}", zip_error_strerror(&error));
  }
  for (const auto& [name, bytes] : entries) TILEGRAD_TRY(AddEntry(zip.get(), name, bytes));
  if (zip_close(zip.get()) != 0) return InternalError("zip: {}", zip_strerror(zip.get()));
  (void)zip.release();
  zip_stat_t info;
  if (zip_source_open(source) != 0 || zip_source_stat(source, &info) != 0)
    return InternalError("zip: cannot read back");
  Bytes out(info.size);
  const zip_int64_t got = zip_source_read(source, out.data(), out.size());
  zip_source_close(source);
  if (got != static_cast<zip_int64_t>(out.size()))
    return InternalError("zip: read back {} of {} bytes", got, out.size());
  return out;
}

}  // namespace

std::optional<std::string> NormalizeName(const std::string& name) {
  if (name.find('\0') != std::string::npos) return std::nullopt;  // the system would cut it there
  std::string slashes = name;
  std::replace(slashes.begin(), slashes.end(), '\\', '/');
  const Path normal = Path(slashes).lexically_normal();
  if (normal.is_absolute() || normal.empty() || *normal.begin() == "..") return std::nullopt;
  return normal.string();
}

std::shared_ptr<FileSource> OpenFolder(const Path& folder, std::vector<Path>* read) {
  return std::make_shared<Folder>(folder, read);
}

Result<std::shared_ptr<FileSource>> OpenZip(const Path& path) {
  TILEGRAD_ASSIGN(ZipHandle zip, OpenZipHandle(path));
  return std::shared_ptr<FileSource>(std::make_shared<Zip>(path, std::move(zip)));
}

Result<Bytes> ReadFromZip(const Bytes& zip, const std::string& place, const std::string& name) {
  zip_error_t error;
  zip_error_init(&error);
  zip_source_t* source = zip_source_buffer_create(zip.data(), zip.size(), /*freep=*/0, &error);
  ZipHandle handle(source == nullptr ? nullptr : zip_open_from_source(source, ZIP_RDONLY, &error));
  if (!handle) zip_source_free(source);
  zip_error_fini(&error);
  if (!handle) return DataLoss("{}: not a zip archive that can be read", place);
  return Zip(place, std::move(handle)).Read(name);
}

Result<std::vector<std::string>> ListZip(const Path& path) {
  TILEGRAD_ASSIGN(ZipHandle zip, OpenZipHandle(path));
  std::vector<std::string> names;
  for (zip_int64_t i = 0; i < zip_get_num_entries(zip.get(), 0); ++i) {
    const char* name = zip_get_name(zip.get(), static_cast<zip_uint64_t>(i), 0);
    if (name != nullptr && *name != '\0' && std::string_view(name).back() != '/')
      names.emplace_back(name);
  }
  return names;
}

Result<std::string> ZipFingerprint(const Path& path) {
  TILEGRAD_ASSIGN(ZipHandle zip, OpenZipHandle(path));
  Hash hash;
  for (zip_int64_t i = 0; i < zip_get_num_entries(zip.get(), 0); ++i) {
    zip_stat_t info;
    if (zip_stat_index(zip.get(), static_cast<zip_uint64_t>(i), 0, &info) != 0 ||
        (~info.valid & (ZIP_STAT_NAME | ZIP_STAT_SIZE | ZIP_STAT_CRC)) != 0) {
      return DataLoss("{}: entry {} has no name, size or checksum", path.string(), i);
    }
    hash.Add(info.name);
    hash.Add(fmt::format("{} {}", info.size, info.crc));
  }
  return hash.Text();
}

Status WriteZip(const Path& path, const std::vector<std::pair<std::string, Bytes>>& entries) {
  auto bytes = EncodeZip(entries);
  if (!bytes.ok()) return bytes.status().Within(path.string());
  return WriteFileAtomic(path, *bytes);
}

}  // namespace tilegrad::io
