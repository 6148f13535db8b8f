// SPDX-License-Identifier: Apache-2.0
// Photographs as a network sees them: square crops around the object, of one size, mirrored or not,
// with keypoints and cameras transformed accordingly. As in CMR's loader, but boxes are not rounded
// to whole pixels.
#pragma once

#include <span>
#include <vector>

#include "base/aligned.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "base/rng.h"
#include "train/data/photographs/photographs.h"

namespace tilegrad::train {

struct CropRule {
  double padding = 0.05;  // of the box on each side, relative to its width and height
  double jitter = 0.05;   // of each edge in training, the same way; at most kMostJitter
  static constexpr double kMostJitter = 0.1;
};

// A square of a photograph, in its pixels.
struct PhotoWindow {
  double left = 0, top = 0, side = 1;
};

// The padded box, with edges moved by up to `jitter` if there is an rng, enlarged to a square about
// its middle.
PhotoWindow WindowOf(const PhotoBox& box, const CropRule& rule, Rng* rng);

// The annotations of a crop. Coordinates are [-1, 1] across it, x right, y down.
struct CroppedPhoto {
  std::vector<Keypoint> keypoints;
  WeakPerspective camera;  // the identity where the photograph has none
  // Converts a length in [-1, 1] units to units of the box's longer side, before padding.
  double to_box = 0.5;
};

// The augmentation of a photograph: `position` determines jitter and mirroring; neither unless
// `random`.
struct CropDraw {
  std::uint64_t seed = 0, position = 0;
  bool random = false;
  double mirrored = 0.5;  // share
};

class PhotoStore {
 public:
  // Reads and crops the pictures of `photographs` (indices into set.photographs, which outlives
  // it). Pixels beyond an edge are white, as CMR's. Memory: 1.44 size^2 * 4 bytes a photograph, on
  // disk where they are many (aligned.h). Errors name a file that is unreadable or not of its
  // mask's size.
  static Result<PhotoStore> Load(const PhotographSet& set, const std::vector<int>& photographs,
                                 const CropRule& rule, int size, const Workers& workers,
                                 const Watch& watch);

  int count() const { return static_cast<int>(photos_.size()); }
  int size() const { return size_; }
  const Photograph& photograph(int i) const { return *photos_[static_cast<std::size_t>(i)]; }

  // Into rgb [3][size][size] and mask [size][size], in [0, 1]. Thread-safe.
  CroppedPhoto Cut(int i, const CropDraw& draw, std::span<float> rgb, std::span<float> mask) const;

 private:
  struct Sub;  // a crop within what is stored
  void Resample(int i, const PhotoWindow& window, bool mirrored, std::span<float> rgb,
                std::span<float> mask) const;
  Status LoadOne(std::size_t i, const Watch& watch);
  std::size_t stored_bytes() const {
    return 4 * static_cast<std::size_t>(stored_) * static_cast<std::size_t>(stored_);
  }

  CropRule rule_;
  std::vector<int> mirror_;  // PhotographSet::mirror
  int size_ = 0, stored_ = 0;
  std::vector<const Photograph*> photos_;
  std::vector<PhotoWindow> windows_;  // what is stored
  ScratchBytes bytes_;                // [photo][4][stored][stored], RGB and mask
};

}  // namespace tilegrad::train
