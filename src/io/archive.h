// SPDX-License-Identifier: Apache-2.0
// Read-only files by name from a folder or a zip archive, so that a model and its textures load the
// same way from both.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/file.h"

namespace tilegrad::io {

// Names use '/', are relative, and may contain "." and ".."; none may escape the source.
class FileSource {
 public:
  virtual ~FileSource() = default;

  // The whole file. Tries the exact name first, then one that differs only in case.
  virtual Result<Bytes> Read(const std::string& name) const = 0;
  virtual bool Exists(const std::string& name) const = 0;
  virtual std::string Describe(
      const std::string& name) const = 0;  // for messages: "chairs.zip: a/b.obj"
};

// Appends the name of each file read to `read` unless null.
std::shared_ptr<FileSource> OpenFolder(const Path& folder, std::vector<Path>* read = nullptr);

// Reading is thread-safe (a lock); an entry may unpack to at most 4 GiB:
// N3MR's renders of tables have 2.3.
Result<std::shared_ptr<FileSource>> OpenZip(const Path& path);

// One entry of a zip in memory; messages call the zip `place`.
Result<Bytes> ReadFromZip(const Bytes& zip, const std::string& place, const std::string& name);

// The names of all entries of a zip except folders.
Result<std::vector<std::string>> ListZip(const Path& path);

// 16 hexadecimal digits that differ if any entry's name or content differs: from the checksums in
// the zip, without unpacking.
Result<std::string> ZipFingerprint(const Path& path);

// Writes a zip with these entries, deflated; atomic.
Status WriteZip(const Path& path, const std::vector<std::pair<std::string, Bytes>>& entries);

// Resolves '\\', ".", ".." and doubled slashes; nullopt if the name is absolute, escapes the root
// or contains NUL.
std::optional<std::string> NormalizeName(const std::string& name);

}  // namespace tilegrad::io
