// SPDX-License-Identifier: Apache-2.0
#include "train/eval/retrieval.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tilegrad::train {
namespace {

constexpr std::size_t kThumbnailSide = kThumbnail,
                      kThumbnailBytes = 4 * kThumbnailSide * kThumbnailSide;

// Adds up to 1024 squares of differences of bytes, which fit in 32 bits.
std::uint32_t ThumbnailDistance(const std::uint8_t* a, const std::uint8_t* b) {
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < kThumbnailBytes; ++i) {
    const int difference = int{a[i]} - int{b[i]};
    sum += static_cast<std::uint32_t>(difference * difference);
  }
  return sum;
}

}  // namespace

std::vector<std::uint8_t> Thumbnail(std::span<const std::uint8_t> image, int size) {
  const auto side = static_cast<std::size_t>(size);
  std::vector<std::uint8_t> out(kThumbnailBytes);
  const auto begin = [&](std::size_t i) { return i * side / kThumbnailSide; };
  const auto end = [&](std::size_t i) { return std::max(begin(i + 1), begin(i) + 1); };
  for (std::size_t c = 0; c < 4; ++c) {
    for (std::size_t y = 0; y < kThumbnailSide; ++y) {
      for (std::size_t x = 0; x < kThumbnailSide; ++x) {
        std::size_t sum = 0, count = 0;
        for (std::size_t j = begin(y); j < end(y); ++j) {
          for (std::size_t i = begin(x); i < end(x); ++i, ++count)
            sum += image[(c * side + j) * side + i];
        }
        out[(c * kThumbnailSide + y) * kThumbnailSide + x] =
            static_cast<std::uint8_t>((sum + count / 2) / count);
      }
    }
  }
  return out;
}

void ImageIndex::Add(std::span<const std::uint8_t> images, int views, int size) {
  const std::size_t image = images.size() / static_cast<std::size_t>(views);
  for (int v = 0; v < views; ++v) {
    const auto small = Thumbnail(images.subspan(static_cast<std::size_t>(v) * image, image), size);
    thumbnails_.insert(thumbnails_.end(), small.begin(), small.end());
    entries_.push_back({models_, v});
  }
  ++models_;
}

ImageIndex::Match ImageIndex::Nearest(std::span<const std::uint8_t> image, int size) const {
  const auto small = Thumbnail(image, size);
  std::uint32_t best = std::numeric_limits<std::uint32_t>::max();
  std::size_t at = 0;
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const std::uint32_t distance =
        ThumbnailDistance(small.data(), &thumbnails_[i * kThumbnailBytes]);
    if (distance < best) {
      best = distance;
      at = i;
    }
  }
  return {entries_[at].model, entries_[at].view, std::sqrt(best / double{kThumbnailBytes}) / 255};
}

}  // namespace tilegrad::train
