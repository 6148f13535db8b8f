// SPDX-License-Identifier: Apache-2.0
#include "train/run/checkpoint.h"

#include <algorithm>
#include <charconv>

#include "base/error.h"
#include "base/hash.h"
#include "train/named_weights.h"
#include "train/run/run_files.h"

namespace tilegrad::train {
namespace {

constexpr std::string_view kCheckpointFormatName = "tilegrad-checkpoint-",
                           kCheckpointFormat = "tilegrad-checkpoint-1";
constexpr std::string_view kStepPrefix = "step_", kStepSuffix = ".safetensors";
constexpr const char *kChecksum = "checksum", *kCredits = "credits";

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
    if (key != kChecksum) {
      hash.Add(key);
      hash.Add(value);
    }
  }
  for (const nn::NamedTensor& t : file.tensors) {
    hash.Add(t.name);
    hash.Add(nn::NameOf(t.value.dtype()));
    hash.Add(t.value.shape().ToString());
    hash.AddBytes(t.value.raw(), t.value.bytes());
  }
  return hash.Text();
}

std::map<std::string, std::string> MetadataOf(const CheckpointInfo& info) {
  std::map<std::string, std::string> out = {{"format", std::string(kCheckpointFormat)},
                                            {"step", std::to_string(info.step)},
                                            {"image_size", std::to_string(info.image_size)},
                                            {"seconds", fmt::format("{}", info.seconds)},
                                            {"half_extent", fmt::format("{}", info.half_extent)},
                                            {"config", info.config}};
  if (!info.credits.empty()) out[kCredits] = info.credits;
  return out;
}

Status CheckFormat(const std::map<std::string, std::string>& metadata, const Path& path) {
  const auto format = metadata.find("format");
  if (format != metadata.end() && format->second == kCheckpointFormat) return {};
  if (format != metadata.end() && format->second.starts_with(kCheckpointFormatName))
    return DataLoss(
        "{}: was written by another version of tilegrad: its format is \"{}\", not \"{}\"",
        path.string(), format->second, kCheckpointFormat);
  return DataLoss(
      "{}: a safetensors file, but not a checkpoint of tilegrad: its metadata has no "
      "format of that name",
      path.string());
}

Status CheckChecksum(const nn::TensorFile& file, const Path& path) {
  const auto checksum = file.metadata.find(kChecksum);
  // Those of earlier versions have none.
  if (checksum == file.metadata.end() || checksum->second == ChecksumOf(file)) return {};
  return DataLoss("{}: its contents do not match its checksum: the file was damaged",
                  path.string());
}

// The tensors and metadata, if all is as it was written. What is no safetensors file, or one that
// is cut short, has lost its checksum with the rest.
Result<nn::TensorFile> WholeContents(nn::Context& context, std::span<const std::uint8_t> bytes,
                                     const Path& path) {
  auto file = nn::DecodeSafetensors(context, bytes);
  if (!file.ok()) return file.status().Within(path.string());
  TILEGRAD_TRY(CheckChecksum(*file, path));
  return file;
}

// `damaged`: the bytes are not those that were written. Any other error may be one of this program
// or of the moment (a newer format, no permission, no memory), and the file a good one.
Result<Checkpoint> Load(nn::Context& context, const Path& path, bool* damaged) {
  *damaged = false;
  TILEGRAD_ASSIGN(const Bytes bytes, ReadFile(path));
  // First, since other versions may store tensors as this one cannot read them.
  if (const auto metadata = nn::SafetensorsMetadata(bytes); metadata.ok())
    TILEGRAD_TRY(CheckFormat(*metadata, path));
  auto file = WholeContents(context, bytes, path);
  *damaged = !file.ok();
  if (!file.ok()) return file.status();
  const auto& m = file->metadata;
  const auto step = Number<std::int64_t>(m, "step"),
             image_size = Number<std::int64_t>(m, "image_size");
  const auto seconds = Number<double>(m, "seconds");
  if (!step || !image_size || !seconds || m.count("config") == 0)
    return DataLoss(
        "{}: not a checkpoint of tilegrad: its metadata lacks step, image_size, seconds or config",
        path.string());
  CheckpointInfo info{*step, *image_size, m.at("config"), *seconds};
  info.half_extent = Number<double>(m, "half_extent").value_or(info.half_extent);
  if (m.count(kCredits) > 0) info.credits = m.at(kCredits);
  return Checkpoint{std::move(info), std::move(file->tensors)};
}

// As ListCheckpoints.
Result<std::vector<Path>> FindFiles(const Path& run) {
  TILEGRAD_ASSIGN(auto found, FilesOfSteps(Folder(run), kStepPrefix, kStepSuffix));
  std::vector<Path> files;
  for (auto& [step, path] : found) files.push_back(std::move(path));
  return files;
}

}  // namespace

Status SaveCheckpoint(const Path& run, const CheckpointInfo& info,
                      std::vector<nn::NamedTensor> tensors) {
  nn::TensorFile file{std::move(tensors), MetadataOf(info)};
  file.metadata[kChecksum] = ChecksumOf(file);
  return nn::WriteSafetensors(
      Folder(run) / fmt::format("{}{:08}{}", kStepPrefix, info.step, kStepSuffix), file);
}

Status WriteWeights(nn::Context& context, const Path& file, const Checkpoint& weights,
                    nn::StoredFloats floats) {
  const nn::TensorFile whole{weights.tensors, MetadataOf(weights.info)};
  const auto bytes = nn::EncodeSafetensors(whole, floats);
  if (!bytes.ok()) return bytes.status().Within(file.string());
  // The checksum is that of what a reader gets.
  TILEGRAD_ASSIGN(nn::TensorFile stored, nn::DecodeSafetensors(context, *bytes));
  stored.metadata[kChecksum] = ChecksumOf(stored);
  return nn::WriteSafetensors(file, stored, floats);
}

Result<Checkpoint> LoadCheckpoint(nn::Context& context, const Path& path) {
  bool damaged = false;
  return Load(context, path, &damaged);
}

std::vector<Path> ListCheckpoints(const Path& run) {
  auto files = FindFiles(run);
  return files.ok() ? std::move(files).value() : std::vector<Path>();
}

Result<FoundCheckpoint> LoadNewestCheckpoint(nn::Context& context, const Path& run) {
  TILEGRAD_ASSIGN(const std::vector<Path> files, FindFiles(run));
  if (files.empty()) {
    const auto holds = HoldsRun(run);
    const char* const what = holds.ok() && *holds ? "" : "not the folder of a run: ";
    return NotFound("{}: {}there is no checkpoint in {}", run.string(), what, Folder(run).string());
  }
  FoundCheckpoint found;
  for (auto file = files.rbegin(); file != files.rend(); ++file) {
    bool damaged = false;
    auto checkpoint = Load(context, *file, &damaged);
    if (checkpoint.ok()) {
      found.checkpoint = std::move(checkpoint).value();
      found.file = *file;
      return found;
    }
    const Status status = checkpoint.status();
    if (!damaged)
      return Status(status.code(),
                    status.message() +
                        "; nothing was changed: fix this to resume from here, or move this file "
                        "away to resume from the previous checkpoint");
    found.warnings.push_back(status.message());
    found.broken.push_back(*file);
  }
  return DataLoss("{}; every checkpoint of this run is damaged: start anew", found.warnings[0]);
}

Result<FoundCheckpoint> FindCheckpoint(nn::Context& context, const Path& path) {
  TILEGRAD_ASSIGN(const Path found, FindRun(path));
  if (IsFolder(found)) return LoadNewestCheckpoint(context, found);
  TILEGRAD_ASSIGN(Checkpoint checkpoint, LoadCheckpoint(context, found));
  return FoundCheckpoint{std::move(checkpoint), found, {}, {}};
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
