// SPDX-License-Identifier: Apache-2.0
#include "fuzz/target.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "base/error.h"
#include "base/read_budget.h"
#include "support/source_dir.h"

namespace tilegrad::fuzz {
namespace {

std::vector<Target>& Registered() {
  static std::vector<Target> targets;
  return targets;
}

}  // namespace

Registration::Registration(const Target& target) { Registered().push_back(target); }

const std::vector<Target>& Targets() {
  std::sort(Registered().begin(), Registered().end(),
            [](const Target& a, const Target& b) { return a.name < b.name; });
  return Registered();
}

std::vector<Path> FilesIn(const char* kind, const std::string& target) {
  std::vector<Path> out;
  const Path folder = Path(TILEGRAD_SOURCE_DIR) / "tests/fuzz" / kind / target;
  if (!std::filesystem::exists(folder)) return out;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) out.push_back(entry.path());
  std::sort(out.begin(), out.end());
  return out;
}

void Run(const Target& target, Input input) {
  const ReadBudget budget(target.read_budget);
  target.run(input);
}

std::vector<Bytes> SeedsOf(const Target& target) {
  if (target.seeds != nullptr) return target.seeds();
  std::vector<Bytes> out;
  for (const Path& file : FilesIn("seeds", target.name)) out.push_back(ReadFile(file).value());
  return out;
}

void Require(bool kept, std::string_view promise) {
  if (kept) return;
  std::fprintf(stderr, "BROKEN PROMISE: %.*s\n", static_cast<int>(promise.size()), promise.data());
  std::abort();
}

std::vector<Input> SplitFiles(Input input) {
  std::vector<Input> out;
  while (true) {
    const auto at = std::search(input.begin(), input.end(), kNextFile.begin(), kNextFile.end());
    out.push_back(input.first(static_cast<std::size_t>(at - input.begin())));
    if (at == input.end()) return out;
    input = input.subspan(out.back().size() + kNextFile.size());
  }
}

Bytes ToBytes(std::string_view text) { return {text.begin(), text.end()}; }

Result<Bytes> MemorySource::Read(const std::string& name) const {
  if (name == name_) return Bytes(files_[0].begin(), files_[0].end());
  if (!Exists(name)) return NotFound("{}: no such file", Describe(name));
  std::size_t which = 1;  // by its letters, so that a file may refer to each of the others
  for (const char c : name) which += static_cast<unsigned char>(c);
  const Input file = files_[1 + which % (files_.size() - 1)];
  return Bytes(file.begin(), file.end());
}

bool MemorySource::Exists(const std::string& name) const {
  return name == name_ || files_.size() > 1;
}

MemoryFile::MemoryFile(Input bytes) : descriptor_(::memfd_create("fuzz", 0)) {
  Require(descriptor_ >= 0, "there is a memory file");
  const auto written = ::write(descriptor_, bytes.data(), bytes.size());
  Require(written == static_cast<::ssize_t>(bytes.size()), "a memory file takes its bytes");
}

MemoryFile::~MemoryFile() { ::close(descriptor_); }

Path MemoryFile::path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

const Path& ScratchFolder() {
  struct Folder {
    Path path = Path(std::filesystem::exists("/dev/shm") ? "/dev/shm" : "/tmp") /
                ("tilegrad-fuzz-" + std::to_string(::getpid()));
    Folder() { std::filesystem::create_directories(path); }
    ~Folder() {
      std::error_code ignored;
      std::filesystem::remove_all(path, ignored);
    }
  };
  static const Folder folder;
  return folder.path;
}

void PutFile(const Path& relative, Input bytes) {
  const Path path = ScratchFolder() / relative;
  std::filesystem::create_directories(path.parent_path());
  std::ofstream out(path, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(bytes.data()),
            static_cast<std::streamsize>(bytes.size()));
}

}  // namespace tilegrad::fuzz
