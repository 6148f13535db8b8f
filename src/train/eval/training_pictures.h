// SPDX-License-Identifier: Apache-2.0
// Thumbnails of a run's training pictures, in its folder: other pictures can be compared with them
// without the dataset.
//
//   <run>/thumbnails.npz    written when training starts, some 3 MB; runs of earlier versions have
//                           none
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/parallel.h"
#include "io/npz.h"
#include "scene/image.h"
#include "tilegrad/status.h"
#include "train/data/batches.h"
#include "train/data/dataset.h"
#include "train/run/carried_files.h"

namespace tilegrad::train {

// The most thumbnails kept, spread evenly over all: 8 MB before compression.
inline constexpr std::size_t kMostThumbnails = 8192;
inline constexpr int kThumbnailSize = 16;  // pixels a side

// A picture is unlike them all if its nearest one is farther than the distance within which
// kUsualShare of the training pictures (up to kMostMeasured) have the nearest one of another shape.
// Held-out models lie as far away, so one picture in ten gets a needless warning.
inline constexpr double kUsualShare = 0.9;
inline constexpr std::size_t kMostMeasured = 1024;

class TrainingPictures {
 public:
  struct Match {
    std::string name, class_name;  // of the model
    double distance = 0;  // [0, 1]: root mean square of differences of colour and of coverage, over
                          // what either picture covers, at kThumbnailSize pixels a side
  };

  // The dataset's training models, whose images `store` holds in the order of Select. Moves and
  // scales objects as PrepareCutout does with Framing::kFit, so that their place in the picture
  // does not matter; skips pictures where nothing is opaque, or all.
  static TrainingPictures Of(const Dataset& dataset, const ImageStore& store,
                             const Workers& workers);
  // From a run folder, from that of a checkpoint, or from a file of weights; nullopt if it has
  // none. Errors name the file and what is wrong.
  static Result<std::optional<TrainingPictures>> Read(const Path& run);
  Status Write(const Path& run) const;

  // The number of the run's training pictures, of which not all may be kept.
  std::int64_t count() const { return count_; }
  // The limit of kUsualShare; nullopt if there is no second shape.
  std::optional<double> usual() const;
  // Whether it is farther than usual(); false without that.
  bool IsUnlike(const Match& match) const;
  // image: as PrepareCutout takes it, framed in any way; its errors. nullopt if no picture is kept.
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
  // The nearest of those with may_match(i), the first of ties; nullopt if there is none.
  template <class MayMatch>
  std::optional<Found> Search(std::span<const std::uint8_t> small, const MayMatch& may_match) const;
  Status Load(const RunFile& file);
  Status Fill(const io::NpzArrays& arrays);
  Status Check() const;

  std::int64_t count_ = 0;
  std::vector<Model> models_;
  std::vector<std::int32_t> of_;        // model of each one kept
  std::vector<std::uint8_t> pictures_;  // [kept][4][kThumbnailSize][kThumbnailSize]
  std::vector<float> others_;           // distances to the nearest of another shape, ascending
};

}  // namespace tilegrad::train
