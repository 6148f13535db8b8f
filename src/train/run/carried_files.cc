// SPDX-License-Identifier: Apache-2.0
#include "train/run/carried_files.h"

#include <cstring>

#include "base/error.h"
#include "nn/serialize.h"
#include "train/run/run_files.h"

namespace tilegrad::train {
namespace {

constexpr const char* kCarried[] = {"thumbnails.npz", kTrainedModels, kTrainedPhotographs};

std::string TensorName(const std::string& file) { return "file." + file; }

Result<std::optional<RunFile>> FromWeights(const Path& weights, const std::string& name) {
  const Workers alone(1);
  nn::Context context(alone);
  TILEGRAD_ASSIGN(const nn::TensorFile file, nn::ReadSafetensors(context, weights));
  const nn::Tensor* const carried = nn::Find(file.tensors, TensorName(name));
  if (carried == nullptr) return std::optional<RunFile>();
  RunFile out{Bytes(carried->bytes()), weights.string() + ": " + name};
  if (!out.bytes.empty()) std::memcpy(out.bytes.data(), carried->raw(), out.bytes.size());
  return std::optional(std::move(out));
}

}  // namespace

Result<std::optional<RunFile>> ReadRunFile(const Path& run, const std::string& name) {
  const Path folder = RunFolderOf(run);
  if (IsFile(folder)) return FromWeights(folder, name);
  const Path file = folder / name;
  if (!PathExists(file)) return std::optional<RunFile>();
  TILEGRAD_ASSIGN(Bytes bytes, ReadFile(file));
  return std::optional(RunFile{std::move(bytes), file.string()});
}

Result<std::vector<nn::NamedTensor>> CarriedFiles(nn::Context& context, const Path& run) {
  std::vector<nn::NamedTensor> out;
  for (const char* name : kCarried) {
    TILEGRAD_ASSIGN(const auto file, ReadRunFile(run, name));
    if (!file) continue;
    const auto size = static_cast<std::int64_t>(file->bytes.size());
    nn::Tensor bytes = context.Empty({size}, nn::DType::kU8);
    if (size > 0) std::memcpy(bytes.raw(), file->bytes.data(), file->bytes.size());
    out.push_back({TensorName(name), std::move(bytes)});
  }
  return out;
}

}  // namespace tilegrad::train
