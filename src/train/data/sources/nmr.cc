// SPDX-License-Identifier: Apache-2.0
// Images and voxels of N3MR and SoftRas as they are published, in our frame.
//
// Their frame is left-handed: image v is seen from (d cos e sin a, d sin e, -d cos e cos a) with a
// = -15 v degrees, e = 30, d = 2.732. With x = -z', z = -x' (primes: theirs) that is our orbit at
// azimuth +15 v. Their evaluation compares the file's grid g with a prediction's grid
// p'[x'][y'][z'] by g[i][j][k] = p'[j][i][31 - k], so ours is p[x][y][z] = g[y][31 - z][x].
#include <map>
#include <memory>
#include <mutex>

#include "base/error.h"
#include "io/npz.h"
#include "train/data/dataset_files.h"
#include "train/data/sources/model_source.h"

namespace tilegrad::train {
namespace {

constexpr std::size_t kNmrViews = 24, kSize = 64, kVoxelSide = kOccupancyResolution;

struct NmrPart {
  std::string class_name;
  Split split;
  Path images, voxels;
};

// The one array of a file, whatever its name; [N] + `item` in shape.
Result<io::NpyArray> LoadOnlyArray(const Path& path, const std::vector<std::size_t>& item) {
  TILEGRAD_ASSIGN(io::NpzArrays arrays, io::LoadNpz(path));
  if (arrays.size() != 1)
    return DataLoss("{}: expected one array, got {}", path.string(), arrays.size());
  io::NpyArray array = std::move(arrays.begin()->second);
  const bool bytes = io::NpyTypeSize(array.type) == 1;
  if (!bytes || array.shape.size() != item.size() + 1 ||
      !std::equal(item.begin(), item.end(), array.shape.begin() + 1)) {
    return DataLoss("{}: expected an array of bytes of shape [N,{}]", path.string(),
                    fmt::join(item, ","));
  }
  return array;
}

Result<io::NpyArray> LoadVoxels(const NmrPart& part) {
  return LoadOnlyArray(part.voxels, {kVoxelSide, kVoxelSide, kVoxelSide});
}

std::vector<std::uint8_t> ToOurFrame(const std::uint8_t* grid) {
  std::vector<std::uint8_t> out;
  out.reserve(kVoxelSide * kVoxelSide * kVoxelSide);
  for (std::size_t x = 0; x < kVoxelSide; ++x) {
    for (std::size_t y = 0; y < kVoxelSide; ++y) {
      for (std::size_t z = 0; z < kVoxelSide; ++z)
        out.push_back(grid[(y * kVoxelSide + (kVoxelSide - 1 - z)) * kVoxelSide + x] != 0);
    }
  }
  return out;
}

class Nmr : public ModelSource {
 public:
  Nmr()
      : ModelSource({.name = "nmr",
                     .credits = {"Renders of ShapeNetCore models by Kato et al. (Neural 3D Mesh "
                                 "Renderer, 2018)."},
                     .published = true}) {}

  Status Add(NmrPart part) {
    TILEGRAD_ASSIGN(const io::NpyArray voxels, LoadVoxels(part));
    if (voxels.shape[0] == 0) ignored_.push_back({part.voxels.string(), "holds no model"});
    for (std::size_t i = 0; i < voxels.shape[0]; ++i) {
      const std::string id = fmt::format("{}-{:05}", SplitName(part.split), i);
      const std::string file = fmt::format("{}: [{}]", part.images.string(), i);
      entries_.push_back({part.class_name, id, id, "ShapeNet terms of use", "", file, part.split});
      places_[file] = {parts_.size(), i};
    }
    parts_.push_back(std::move(part));
    failures_.emplace_back();
    return {};
  }
  void Sort() { SortEntries(&entries_); }

  std::optional<DatasetInfo> FixedInfo() const override {
    DatasetInfo info;
    info.image_size = kSize;
    info.views = kNmrViews;
    info.camera = NmrCameras();
    return info;
  }

  Result<SourceModel> Load(std::size_t entry) const override {
    const auto& [part, row] = places_.at(FileOf(entry));
    TILEGRAD_ASSIGN(const auto arrays, Fetch(part));
    if (row >= arrays->images.shape[0])
      return DataLoss("{}: {} models, but its voxels are {}", parts_[part].images.string(),
                      arrays->images.shape[0], arrays->voxels.shape[0]);
    constexpr std::size_t kImageBytes = kNmrViews * 4 * kSize * kSize;
    const auto* images = arrays->images.data.data() + row * kImageBytes;
    ModelData data;
    data.images.assign(images, images + kImageBytes);
    data.occupancy =
        ToOurFrame(arrays->voxels.data.data() + row * kVoxelSide * kVoxelSide * kVoxelSide);
    return SourceModel{std::move(data)};
  }

 private:
  struct Arrays {
    io::NpyArray images, voxels;
  };

  // Entries come in ascending order, so one pair of files is enough to keep.
  Result<std::shared_ptr<const Arrays>> Fetch(std::size_t part) const {
    const std::lock_guard lock(mutex_);
    if (cached_ != nullptr && cached_part_ == part) return cached_;
    TILEGRAD_TRY(failures_[part]);
    cached_ = nullptr;
    auto arrays = ReadArrays(part);
    failures_[part] = arrays.status();
    if (!arrays.ok()) return failures_[part];
    cached_ = std::make_shared<const Arrays>(std::move(*arrays));
    cached_part_ = part;
    return cached_;
  }

  Result<Arrays> ReadArrays(std::size_t part) const {
    Arrays arrays;
    TILEGRAD_ASSIGN(arrays.images,
                    LoadOnlyArray(parts_[part].images, {kNmrViews, 4, kSize, kSize}));
    TILEGRAD_ASSIGN(arrays.voxels, LoadVoxels(parts_[part]));
    return arrays;
  }

  std::vector<NmrPart> parts_;
  // By SourceEntry::file: the part and the row in it.
  std::map<std::string, std::pair<std::size_t, std::size_t>> places_;
  mutable std::mutex mutex_;
  mutable std::shared_ptr<const Arrays> cached_;
  mutable std::size_t cached_part_ = 0;
  mutable std::vector<Status> failures_;  // by part: a broken file is not read for each model
};

// "chair_train_images.npz" -> chair, train; nothing for other names.
std::optional<NmrPart> ParsePart(const Path& file) {
  constexpr std::pair<const char*, Split> kEndings[] = {{"_train_images.npz", Split::kTrain},
                                                        {"_val_images.npz", Split::kValidation},
                                                        {"_test_images.npz", Split::kTest}};
  const std::string name = file.filename().string();
  for (const auto& [ending, split] : kEndings) {
    const std::string tail = ending;
    if (name.size() <= tail.size() || name.substr(name.size() - tail.size()) != tail) continue;
    const std::string stem = name.substr(0, name.size() - std::string("images.npz").size());
    const std::string class_name = name.substr(0, name.size() - tail.size());
    return NmrPart{SafeFileName(SynsetName(class_name)), split, file,
                   file.parent_path() / (stem + "voxels.npz")};
  }
  return std::nullopt;
}

}  // namespace

CameraRule NmrCameras() {
  CameraRule rule;
  rule.lens.fov_y = 30;
  rule.azimuth_step = 15;
  rule.elevation = 30;
  rule.distance = 2.732;
  rule.half_extent = 0.5;
  return rule;
}

Result<std::unique_ptr<ModelSource>> NmrSource(const Path& folder) {
  TILEGRAD_ASSIGN(const auto files, ListFolder(folder));
  auto source = std::make_unique<Nmr>();
  for (const Path& file : files) {
    if (auto part = ParsePart(file)) TILEGRAD_TRY(source->Add(std::move(*part)));
  }
  if (source->entries().empty())
    return NotFound("{}: expected <class>_<train|val|test>_images.npz and _voxels.npz",
                    folder.string());
  source->Sort();
  return std::unique_ptr<ModelSource>(std::move(source));
}

}  // namespace tilegrad::train
