// SPDX-License-Identifier: Apache-2.0
// The pictures that a run is trained on, small, in its folder: whether another picture is like
// them can then be said without the dataset.
//
//   <run>/thumbnails.npz    written when training starts, some 3 MB; runs of earlier versions have
//                           none
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/parallel.h"
#include "io/npz.h"
#include "scene/image.h"
#include "train/data/batches.h"
#include "train/data/dataset.h"
#include "train/run/carried_files.h"

namespace tilegrad::train {

// At most so many are kept, spread evenly over all: 8 MB before compression.
inline constexpr std::size_t kMostThumbnails = 8192;
inline constexpr int kThumbnailSize = 16;  // pixels a side

// A picture is unlike them all when the nearest is further away than kUsualShare of the training
// pictures have the nearest one of another shape, measured at up to kMostMeasured of them. Held-out
// models keep that distance as the training models among themselves do: one picture in ten is
// warned of that need not be.
inline constexpr double kUsualShare = 0.9;
inline constexpr std::size_t kMostMeasured = 1024;

class TrainingPictures {
 public:
  struct Match {
    std::string name, class_name;  // of the model
    double distance = 0;  // [0, 1]: root mean square of differences of colour and of coverage, over
                          // what either picture covers, at kThumbnailSize pixels a side
  };

  // The dataset's training models, whose images `store` holds in the order of Select. Objects are
  // moved and scaled as PrepareCutout does with Framing::kFit, so that where an object stands in a
  // picture makes no difference; pictures where nothing is opaque, or all, are left out.
  static TrainingPictures Of(const Dataset& dataset, const ImageStore& store,
                             const Workers& workers);
  // Of a run folder, of that of one checkpoint, or as a file of weights carries them; nothing if
  // there is no such file. Errors name the file and what is wrong.
  static Result<std::optional<TrainingPictures>> Read(const Path& run);
  Status Write(const Path& run) const;

  // Of pictures that the run was trained on; more than are kept.
  std::int64_t count() const { return count_; }
  // The distance that kUsualShare keep; none where there is no second shape.
  std::optional<double> usual() const;
  // Whether it is further away; false where there is nothing to compare with.
  bool IsUnlike(const Match& match) const;
  // image: as PrepareCutout takes it, framed in any way; its errors. None where none is kept.
  Result<std::optional<Match>> Nearest(const ImageU8& image) const;

 private:
  struct Model {
    std::string name, class_name;
  };
  void Keep(const ImageStore& store, const Workers& workers);
  void Measure(std::span<const int> shapes, const Workers& workers);
  std::span<const std::uint8_t> Picture(std::size_t i) const;
  struct Found {
    std::size_t picture;
    double square;  // of the distance
  };
  // The first of the nearest among those that may_match(i); none if there is none.
  template <class MayMatch>
  std::optional<Found> Search(std::span<const std::uint8_t> small, const MayMatch& may_match) const;
  Status Load(const RunFile& file);
  Status Fill(const io::NpzArrays& arrays);
  Status Check() const;

  std::int64_t count_ = 0;
  std::vector<Model> models_;
  std::vector<std::int32_t> of_;        // model of each that is kept
  std::vector<std::uint8_t> pictures_;  // [kept][4][kThumbnailSize][kThumbnailSize]
  std::vector<float> others_;           // distances to the nearest of another shape, ascending
};

}  // namespace tilegrad::train
