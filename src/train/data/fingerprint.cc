// SPDX-License-Identifier: Apache-2.0
#include "train/data/fingerprint.h"

#include "base/file.h"
#include "base/hash.h"
#include "base/try_all.h"
#include "train/data/dataset_files.h"

namespace tilegrad::train {
namespace {

Result<std::string> HashOfFile(const Path& path) {
  TILEGRAD_ASSIGN(const Bytes bytes, ReadFile(path));
  Hash hash;
  hash.AddBytes(bytes.data(), bytes.size());
  return hash.Text();
}

Status AddFiles(const std::vector<Path>& files, const Workers& workers, Hash* all) {
  std::vector<std::string> hashes(files.size());
  const auto read = [&](std::size_t i, std::size_t) -> Status {
    TILEGRAD_ASSIGN(hashes[i], HashOfFile(files[i]));
    return {};
  };
  TILEGRAD_TRY(TryAll(workers, files.size(), read));
  for (const auto& hash : hashes) all->Add(hash);
  return {};
}

Result<std::string> DatasetFingerprint(const Path& folder, const Workers& workers) {
  TILEGRAD_ASSIGN(const Dataset dataset, Dataset::Open(folder));
  std::vector<Path> files = {DatasetInfoPath(folder), ModelsPath(folder)};
  for (std::size_t m = 0; m < dataset.models().size(); ++m)
    files.push_back(dataset.ModelPath(static_cast<int>(m)));
  Hash all;
  TILEGRAD_TRY(AddFiles(files, workers, &all));
  return all.Text();
}

Result<std::string> PhotographsFingerprint(const Path& folder, const Workers& workers) {
  TILEGRAD_ASSIGN(const PhotographSet set, OpenPhotographs(folder));
  std::vector<std::string> hashes(set.photographs.size());
  const auto read = [&](std::size_t i, std::size_t) -> Status {
    TILEGRAD_ASSIGN(hashes[i], PhotographFingerprint(set.photographs[i]));
    return {};
  };
  TILEGRAD_TRY(TryAll(workers, hashes.size(), read));
  Hash all;
  for (const std::string& hash : hashes) all.Add(hash);
  for (const auto& point : set.mean_keypoints) all.AddAll(point);
  return all.Text();
}

}  // namespace

Result<std::string> DataFingerprint(const Path& folder, const Workers& workers) {
  return PathExists(DatasetInfoPath(folder)) ? DatasetFingerprint(folder, workers)
                                             : PhotographsFingerprint(folder, workers);
}

Result<std::string> PhotographFingerprint(const Photograph& photo) {
  const WeakPerspective camera = photo.camera.value_or(WeakPerspective{.scale = 0});
  const auto& [left, top, right, bottom] = photo.box;
  const auto split = static_cast<double>(photo.split);
  std::vector<double> numbers = {split, left, top, right, bottom, camera.scale};
  numbers.insert(numbers.end(), camera.translation.begin(), camera.translation.end());
  numbers.insert(numbers.end(), camera.quaternion.begin(), camera.quaternion.end());
  for (const Keypoint& k : photo.keypoints)
    if (k.visible) numbers.insert(numbers.end(), {k.x, k.y});
  const std::vector<std::uint8_t> mask(photo.mask.inside.begin(), photo.mask.inside.end());
  Hash annotations;
  annotations.Add(photo.id);
  // Not doubles: the last bits of a camera that was computed may depend on the machine.
  annotations.AddAll(std::vector<float>(numbers.begin(), numbers.end()));
  annotations.AddBytes(mask.data(), mask.size());
  return WithFile(annotations.Text(), photo.image);
}

Result<std::string> WithFile(const std::string& fingerprint, const Path& file) {
  Hash both;
  both.Add(fingerprint);
  TILEGRAD_ASSIGN(const std::string own, HashOfFile(file));
  both.Add(own);
  return both.Text();
}

}  // namespace tilegrad::train
