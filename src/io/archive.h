// SPDX-License-Identifier: Apache-2.0
// Read-only files, from a folder or from a zip archive, by name: so that a model and its textures
// load the same way from both.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/file.h"

namespace tilegrad::io {

// Names use '/', are relative, and may contain "." and ".."; none leads out of the source.
class FileSource {
 public:
  virtual ~FileSource() = default;

  // The whole file. The exact name first, then one that differs in upper and lower case only.
  virtual Result<Bytes> Read(const std::string& name) const = 0;
  virtual bool Exists(const std::string& name) const = 0;
  virtual std::string Describe(
      const std::string& name) const = 0;  // for messages: "chairs.zip: a/b.obj"
};

// Adds the name of each file that is read to `read`, if that is given.
std::shared_ptr<FileSource> OpenFolder(const Path& folder, std::vector<Path>* read = nullptr);

// Reading is thread-safe (a lock); one entry may be at most 4 GiB unpacked:
// N3MR's renders of tables have 2.3.
Result<std::shared_ptr<FileSource>> OpenZip(const Path& path);

// One entry of a zip in memory; `place` stands for the zip in messages.
Result<Bytes> ReadFromZip(const Bytes& zip, const std::string& place, const std::string& name);

// The names of all entries of a zip, folders left out.
Result<std::vector<std::string>> ListZip(const Path& path);

// 16 hexadecimal digits, others if any entry's name or content is another: from the checksums that
// the zip keeps, without unpacking.
Result<std::string> ZipFingerprint(const Path& path);

// Writes a zip with these entries, deflated, whole or not at all.
Status WriteZip(const Path& path, const std::vector<std::pair<std::string, Bytes>>& entries);

// Resolves '\\', ".", ".." and doubled slashes; nothing if the name is absolute, leads out or has a
// NUL in it.
std::optional<std::string> NormalizeName(const std::string& name);

}  // namespace tilegrad::io
