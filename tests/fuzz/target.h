// SPDX-License-Identifier: Apache-2.0
// Fuzz targets: functions that must survive any bytes. With libFuzzer (cmake --preset fuzz) each is
// a program of its own; in every other build replay_test.cc runs all of them over their seeds, over
// mutations of these, and over what was found before.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "io/archive.h"

namespace tilegrad::fuzz {

using Input = std::span<const std::uint8_t>;

struct Target {
  std::string name;
  void (*run)(Input input);
  std::vector<Bytes> (*seeds)() = nullptr;  // small and sound; null: the files of seeds/<name>
  // Mends what a mutation breaks with certainty, as checksums; null: nothing.
  void (*repair)(std::span<std::uint8_t> bytes) = nullptr;
  int mutations = 200;  // of each seed in tests: few where one starts processes or threads
  std::size_t read_budget = std::size_t{64} << 20;  // bytes
};

void Run(const Target& target, Input input);
std::vector<Bytes> SeedsOf(const Target& target);
// Files of seeds/, corpus/ or found/, by name: of a target, or its folders if that is "".
std::vector<Path> FilesIn(const char* kind, const std::string& target);

// Of all targets that are linked in, by name.
const std::vector<Target>& Targets();
struct Registration {
  explicit Registration(const Target& target);
};

// Ends the program with the message unless `kept`: a promise that no input may break.
void Require(bool kept, std::string_view promise);

// Whether there is a result; an error says why there is none.
template <class T>
bool Accepted(const Result<T>& result) {
  Require(result.ok() || !result.status().message().empty(), "an error has a message");
  return result.ok();
}

// An input that is several files: they are separated by this line. The first is the main one.
inline constexpr std::string_view kNextFile = "\n=%=next file=%=\n";
std::vector<Input> SplitFiles(Input input);
Bytes ToBytes(std::string_view text);

// One file by its name, and others that serve any other name, in turn.
class MemorySource final : public io::FileSource {
 public:
  MemorySource(std::string name, Input input) : name_(std::move(name)), files_(SplitFiles(input)) {}
  Result<Bytes> Read(const std::string& name) const override;
  bool Exists(const std::string& name) const override;
  std::string Describe(const std::string& name) const override { return "memory: " + name; }

 private:
  std::string name_;
  std::vector<Input> files_;
};

// A file without a place on a disk, for readers that want a path.
class MemoryFile {
 public:
  explicit MemoryFile(Input bytes);
  ~MemoryFile();
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  Path path() const;

 private:
  int descriptor_;
};

// A folder in memory, the same for all calls of this process, gone at its end.
const Path& ScratchFolder();
void PutFile(const Path& relative, Input bytes);

}  // namespace tilegrad::fuzz
