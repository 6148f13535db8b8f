// SPDX-License-Identifier: Apache-2.0
// The nearest training picture: a baseline that only memorises, and a measure of how unlike the
// training data an input is.
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

// Pictures averaged to kThumbnail x kThumbnail, RGBA: small differences of pose matter less, and a
// search takes a sixteenth of the time.
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
  // The first of ties. Needs at least one picture.
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

// The best prediction that ignores the image: the mean shape of the training models.

struct SingleShape {
  std::vector<std::uint8_t> occupancy;  // in the layout of the grids
  double threshold = 0;                 // a voxel is solid if this share of the grids has it
  double mean_iou = 0;                  // over the grids
};

// Uses the threshold k/256 with the best mean IoU over `grids`, which have one size and hold 0 or
// 1; the lowest of ties. At least one grid.
SingleShape BestSingleShape(std::span<const std::vector<std::uint8_t>> grids);

// The faces between solid and empty voxels of [n][n][n] as a closed mesh in voxel units, outside
// counter-clockwise. The squares share no vertices.
Mesh VoxelSurface(std::span<const std::uint8_t> occupancy, int n);

// Thumbnails of a run's training pictures, in its folder: other pictures can be compared with them
// without the dataset.
//
//   <run>/thumbnails.npz    written when training starts, some 3 MB; runs of earlier versions have
//                           none

// The most thumbnails kept, spread evenly over all: 8 MB before compression.
inline constexpr std::size_t kMostThumbnails = 8192;
inline constexpr int kThumbnailSize = 16;  // pixels a side

// A picture is unlike them all if its nearest one is farther than a limit: the distance within
// which kUsualShare of the training pictures, of which up to kMostMeasured are measured, have the
// nearest one of another shape. Held-out models are as far from training models as these are from
// each other, so one picture in ten gets a needless warning.
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
