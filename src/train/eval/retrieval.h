// SPDX-License-Identifier: Apache-2.0
// The training picture that is most like another one: a baseline that remembers, and a measure of
// how unlike its training data an input is.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/parallel.h"

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

}  // namespace tilegrad::train
