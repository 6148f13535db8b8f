// SPDX-License-Identifier: Apache-2.0
#include "train/run/checkpoint.h"

#include <algorithm>
#include <charconv>

#include "base/error.h"
#include "base/hash.h"
#include "base/temporary_file.h"

namespace tilegrad::train {
namespace {

constexpr const char* kFormat = "tilegrad-checkpoint-1";
constexpr std::string_view kPrefix = "step_", kSuffix = ".safetensors";
constexpr const char* kChecksum = "checksum";

Path Folder(const Path& run) { return run / "checkpoints"; }

template <class T>
std::optional<T> Number(const std::map<std::string, std::string>& metadata,
                        const std::string& key) {
  const auto it = metadata.find(key);
  if (it == metadata.end()) return std::nullopt;
  T value{};
  const char* end = it->second.data() + it->second.size();
  const auto [at, error] = std::from_chars(it->second.data(), end, value);
  return error == std::errc() && at == end ? std::optional(value) : std::nullopt;
}

// Of all that a checkpoint holds: safetensors has no check of its own, and a weight with one wrong
// bit is a weight like any other.
std::string ChecksumOf(const nn::TensorFile& file) {
  Hash hash;
  for (const auto& [key, value] : file.metadata) {
    if (key != kChecksum) hash.Add(key), hash.Add(value);
  }
  for (const nn::NamedTensor& t : file.tensors) {
    hash.Add(t.name), hash.Add(nn::NameOf(t.value.dtype())), hash.Add(t.value.shape().ToString());
    hash.AddBytes(t.value.raw(), t.value.bytes());
  }
  return hash.Text();
}

// The number in "step_00000012.safetensors"; nothing for files that people put beside them.
std::optional<std::int64_t> StepOf(const Path& file) {
  const std::string name = file.filename().string();
  if (!name.starts_with(kPrefix) || !name.ends_with(kSuffix)) return std::nullopt;
  std::int64_t step = 0;
  const char* end = name.data() + name.size() - kSuffix.size();
  const auto [at, error] = std::from_chars(name.data() + kPrefix.size(), end, step);
  return error == std::errc() && at == end && step >= 0 ? std::optional(step) : std::nullopt;
}

}  // namespace

Status SaveCheckpoint(const Path& run, const CheckpointInfo& info,
                      std::vector<nn::NamedTensor> tensors) {
  nn::TensorFile file{std::move(tensors),
                      {{"format", kFormat},
                       {"step", std::to_string(info.step)},
                       {"image_size", std::to_string(info.image_size)},
                       {"seconds", fmt::format("{}", info.seconds)},
                       {"config", info.config}}};
  file.metadata[kChecksum] = ChecksumOf(file);
  return nn::WriteSafetensors(Folder(run) / fmt::format("{}{:08}{}", kPrefix, info.step, kSuffix),
                              file);
}

Result<Checkpoint> LoadCheckpoint(nn::Context& context, const Path& path) {
  TILEGRAD_ASSIGN(nn::TensorFile file, nn::ReadSafetensors(context, path));
  const auto& m = file.metadata;
  // Those of earlier versions have none.
  if (m.count(kChecksum) > 0 && m.at(kChecksum) != ChecksumOf(file)) {
    return DataLoss("{}: its contents do not match its checksum: the file was damaged",
                    path.string());
  }
  const auto step = Number<std::int64_t>(m, "step"),
             image_size = Number<std::int64_t>(m, "image_size");
  const auto seconds = Number<double>(m, "seconds");
  if (m.count("format") == 0 || m.at("format") != kFormat || !step || !image_size || !seconds ||
      m.count("config") == 0) {
    return DataLoss(
        "{}: a safetensors file, but not a checkpoint of tilegrad (its metadata lacks format, "
        "step, image_size, seconds "
        "or config)",
        path.string());
  }
  return Checkpoint{{*step, *image_size, m.at("config"), *seconds}, std::move(file.tensors)};
}

std::vector<Path> ListCheckpoints(const Path& run) {
  std::vector<std::pair<std::int64_t, Path>> found;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(Folder(run), error)) {
    if (const auto step = StepOf(entry.path())) found.emplace_back(*step, entry.path());
  }
  std::sort(found.begin(), found.end());
  std::vector<Path> files;
  for (auto& [step, path] : found) files.push_back(std::move(path));
  return files;
}

Result<FoundCheckpoint> LoadNewestCheckpoint(nn::Context& context, const Path& run) {
  std::vector<Path> files = ListCheckpoints(run);
  if (files.empty()) return NotFound("{}: no checkpoint in it", Folder(run).string());
  FoundCheckpoint found;
  Status first_failure;
  for (auto file = files.rbegin(); file != files.rend(); ++file) {
    auto checkpoint = LoadCheckpoint(context, *file);
    if (checkpoint.ok()) {
      found.checkpoint = std::move(checkpoint).value();
      found.file = *file;
      return found;
    }
    found.warnings.push_back(checkpoint.status().message());
    found.broken.push_back(*file);
    if (first_failure.ok()) first_failure = checkpoint.status();
  }
  return first_failure;
}

Result<FoundCheckpoint> FindCheckpoint(nn::Context& context, const Path& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) return LoadNewestCheckpoint(context, path);
  TILEGRAD_ASSIGN(Checkpoint checkpoint, LoadCheckpoint(context, path));
  return FoundCheckpoint{std::move(checkpoint), path, {}, {}};
}

void SetAside(const std::vector<Path>& broken) {
  std::error_code error;
  for (const Path& file : broken) {
    Path aside = file;
    std::filesystem::rename(file, aside += ".broken", error);
  }
}

void PruneCheckpoints(const Path& run, std::int64_t keep) {
  std::error_code error;
  const std::vector<Path> files = ListCheckpoints(run);
  const auto kept = std::min(files.size(), static_cast<std::size_t>(keep));
  for (std::size_t i = 0; i + kept < files.size(); ++i) std::filesystem::remove(files[i], error);
}

void RemoveHalfWritten(const Path& run) {
  for (const char* folder : {"checkpoints", "samples", "tensorboard", "timelapse"})
    RemoveTemporaries(run / folder);
  RemoveTemporaries(run);
}

}  // namespace tilegrad::train
