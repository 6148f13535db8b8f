// SPDX-License-Identifier: Apache-2.0
#include "train/data/fingerprint.h"

#include "base/hash.h"
#include "train/data/dataset_files.h"

namespace tilegrad::train {
namespace {

Result<std::string> HashOfFile(const Path& path) {
  TILEGRAD_ASSIGN(const Bytes bytes, ReadFile(path));
  Hash hash;
  hash.AddBytes(bytes.data(), bytes.size());
  return hash.Text();
}

}  // namespace

Result<std::string> DatasetFingerprint(const Path& folder, const Workers& workers) {
  TILEGRAD_ASSIGN(const Dataset dataset, Dataset::Open(folder));
  std::vector<Path> files = {DatasetInfoPath(folder), ModelsPath(folder)};
  for (std::size_t m = 0; m < dataset.models().size(); ++m)
    files.push_back(dataset.ModelPath(static_cast<int>(m)));
  std::vector<std::string> hashes(files.size());
  std::vector<Status> failures(files.size());
  workers.For(files.size(), [&](std::size_t i, std::size_t) {
    auto hash = HashOfFile(files[i]);
    failures[i] = hash.status();
    if (hash.ok()) hashes[i] = *hash;
  });
  Hash all;
  for (std::size_t i = 0; i < files.size(); ++i) {
    TILEGRAD_TRY(failures[i]);
    all.Add(hashes[i]);
  }
  return all.Text();
}

}  // namespace tilegrad::train
