// SPDX-License-Identifier: Apache-2.0
#include "train/data/photographs/collect.h"

#include "base/error.h"
#include "base/file.h"
#include "base/read_budget.h"
#include "base/try_all.h"
#include "io/image_file.h"
#include "train/data/photographs/pascal3d.h"
#include "train/data/photographs/photographs.h"

namespace tilegrad::train {
namespace {

// The pictures of a set that is annotated as CMR does.
Status TakePictures(const CollectionJob& job, const Path& images, const MemberWork& work,
                    PhotographSet* set, CollectionSummary* summary) {
  std::vector<std::string> names;
  for (const Photograph& photo : set->photographs) names.push_back(photo.id);
  const std::size_t total = names.size() + summary->broken.count();
  std::vector<char> good(names.size(), 0);
  const auto take = [&](std::size_t i, std::size_t) -> Status {
    const Photograph& photo = set->photographs[i];
    TILEGRAD_TRY(CheckPhotograph(photo));
    TILEGRAD_ASSIGN(const ImageSize size, TakePicture(photo.image, images / photo.id));
    good[i] = size.width == photo.mask.width && size.height == photo.mask.height;
    if (good[i]) return {};
    return InvalidArgument("{} x {} pixels, but its mask has {} x {}", size.width, size.height,
                           photo.mask.width, photo.mask.height);
  };
  TILEGRAD_TRY(TakeMembers(names, work, take, &summary->broken));
  TILEGRAD_TRY(summary->broken.Check(total, job.allow_broken));
  std::vector<Photograph> kept;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (good[i]) kept.push_back(std::move(set->photographs[i]));
  }
  set->photographs = std::move(kept);
  return {};
}

Result<PhotographSet> CollectSet(const CollectionJob& job, const Path& folder,
                                 const MemberWork& work, CollectionSummary* summary) {
  const bool pascal = job.source == "pascal3d";
  const Path images = folder / (pascal ? "Images" : "images");
  std::optional<PhotographSet> set;
  BrokenMembers broken;
  if (job.masks.empty()) {
    TILEGRAD_ASSIGN(set, OpenCmrLayout(job.input, &broken));
  }
  const bool other =
      set && (set->source != job.source || (pascal && set->class_name != job.class_name));
  if (set && !other) {
    summary->broken = std::move(broken);
    TILEGRAD_TRY(TakePictures(job, images, work, &*set, summary));
    return std::move(*set);
  }
  if (pascal) return ReadPascal3d(job, images, work, summary);
  return NotFound("{}: no data/train_cub_cleaned.mat of CMR in it", job.input.string());
}

}  // namespace

Result<CollectionSummary> CollectPhotographs(const CollectionJob& job, const Path& folder,
                                             const Workers& workers, const Watch& watch) {
  if (!IsFolder(job.input)) return NotFound("{}: no such folder", job.input.string());
  CollectionSummary summary;
  TILEGRAD_ASSIGN(const PhotographSet set, CollectSet(job, folder, {workers, watch}, &summary));
  for (const Photograph& photo : set.photographs)
    ++summary.photographs[static_cast<std::size_t>(photo.split)];
  if (set.Select(Split::kTrain).empty())
    return NotFound("{}: no usable photograph of class {} to train on", job.input.string(),
                    job.source == "cub" ? "bird" : job.class_name);
  TILEGRAD_TRY(WriteCmrLayout(folder, set));
  return summary;
}

Status TakeMembers(const std::vector<std::string>& names, const MemberWork& work,
                   FunctionRef<Status(std::size_t, std::size_t)> take, BrokenMembers* broken) {
  const ShortageWatch shortage;
  std::vector<Status> failures(names.size());
  TILEGRAD_TRY(TryAll(work.workers, names.size(), {"reading photographs", work.watch},
                      [&](std::size_t i, std::size_t worker) {
                        failures[i] = take(i, worker);
                        return Status();
                      }));
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (failures[i].ok()) continue;
    TILEGRAD_TRY(shortage.Check(names[i]));
    if (failures[i].code() == StatusCode::kResourceExhausted) return failures[i];
    broken->Add(names[i], std::string(failures[i].message()));
  }
  return {};
}

Result<ImageSize> TakePicture(const Path& from, const Path& to) {
  TILEGRAD_ASSIGN(const io::StoredImage read, io::LoadStoredImage(from));
  TILEGRAD_ASSIGN(const Bytes bytes, ReadFile(from));
  std::error_code error;
  if (std::filesystem::file_size(to, error) != bytes.size() || error)
    TILEGRAD_TRY(WriteFileAtomic(to, bytes));
  return ImageSize{read.image.width, read.image.height};
}

}  // namespace tilegrad::train
