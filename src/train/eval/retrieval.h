// SPDX-License-Identifier: Apache-2.0
// The training picture that is most like another one: a baseline that remembers, and a measure of
// how unlike its training data an input is.
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
#include "scene/mesh.h"
#include "tilegrad/status.h"
#include "train/data/batches.h"
#include "train/data/dataset.h"
#include "train/run/carried_files.h"

namespace tilegrad::train {

// Pictures averaged to kThumbnail x kThumbnail, RGBA: smaller differences of pose count less there,
// and a search takes a sixteenth of the time.
inline constexpr int kThumbnail = 16;

// [4][kThumbnail][kThumbnail] of planar RGBA [4][size][size]; `size` is a multiple of kThumbnail,
// or the mean is over the nearest whole pixels.
std::vector<std::uint8_t> Thumbnail(std::span<const std::uint8_t> image, int size);

class ImageIndex {
 public:
  struct Match {
    int model = 0, view = 0;
    double distance = 0;  // root mean square difference of thumbnails, [0, 1]
  };

  // Pictures [views][4][size][size] of one model; models count from 0 in the order of calls.
  void Add(std::span<const std::uint8_t> images, int views, int size);
  // The first of equals. There is at least one picture.
  Match Nearest(std::span<const std::uint8_t> image, int size) const;
  std::size_t size() const { return entries_.size(); }

 private:
  struct Entry {
    int model, view;
  };
  std::vector<Entry> entries_;
  std::vector<std::uint8_t> thumbnails_;
  int models_ = 0;
};

// The best answer that does not look at the image: the mean shape of the training models.

struct SingleShape {
  std::vector<std::uint8_t> occupancy;  // as the grids it was made of
  double threshold = 0;                 // a voxel is solid if this share of the grids has it
  double mean_iou = 0;                  // over the grids
};

// Of all thresholds k/256 the one with the best mean IoU over `grids`, which have one size and hold
// 0 or 1; the lowest of equals. At least one grid.
SingleShape BestSingleShape(std::span<const std::vector<std::uint8_t>> grids);

// The faces between solid and empty voxels of [n][n][n] as a closed mesh in voxel units, outside
// counter-clockwise. Every solid voxel brings its own corners.
Mesh VoxelSurface(std::span<const std::uint8_t> occupancy, int n);

// The pictures that a run is trained on, small, in its folder: whether another picture is like
// them can then be said without the dataset.
//
//   <run>/thumbnails.npz    written when training starts, some 3 MB; runs of earlier versions have
//                           none

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
