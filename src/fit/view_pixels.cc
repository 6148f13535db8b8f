// SPDX-License-Identifier: Apache-2.0
#include "fit/view_pixels.h"

#include <algorithm>

#include "base/error.h"
#include "io/image_file.h"
#include "train/data/cutout.h"

namespace tilegrad::train {
namespace {

// NeRF programs differ: some turn images first, some ignore the tag as COLMAP does. Where the
// camera's size is that of the stored image and not of the upright one, it counts stored pixels.
Result<ImageU8> LoadTarget(const TransformsFrame& frame) {
  TILEGRAD_ASSIGN(io::StoredImage stored, io::LoadStoredImage(frame.image));
  if (frame.stored_order) return std::move(stored.image);
  const ImageSize meant = frame.camera.size.value_or(ImageSize());
  const auto fits = [&](const ImageU8& image) {
    return std::int64_t{image.width} * meant.height == std::int64_t{image.height} * meant.width;
  };
  const bool fits_stored = meant.width > 0 && fits(stored.image);
  ImageU8 upright = io::Upright(stored.image, stored.orientation);
  return fits_stored && !fits(upright) ? std::move(stored.image) : std::move(upright);
}

Status TakeMask(const Path& path, ViewPixels* out) {
  TILEGRAD_ASSIGN(const ImageU8 mask, io::LoadImage(path));
  if (mask.width != out->size.width || mask.height != out->size.height) {
    return DataLoss("{}: the mask has {} x {} pixels, its image {} x {}", path.string(), mask.width,
                    mask.height, out->size.width, out->size.height);
  }
  const std::vector<std::uint8_t> values = MaskValues(mask);
  std::ranges::transform(values, out->alpha.begin(),
                         [](std::uint8_t v) { return static_cast<float>(v) / 255; });
  out->mask = path.string();
  return {};
}

void TakeImage(const ImageU8& image, ViewPixels* out) {
  const auto channels = static_cast<std::size_t>(image.channels);
  const std::size_t plane = image.pixels.size() / channels;
  const bool has_alpha = channels == 2 || channels == 4;
  out->size = {image.width, image.height};
  out->color.resize(3 * plane);
  out->alpha.resize(plane);
  for (std::size_t p = 0; p < plane; ++p) {
    const std::uint8_t* pixel = &image.pixels[channels * p];
    for (std::size_t c = 0; c < 3; ++c) {
      out->color[c * plane + p] = static_cast<float>(pixel[channels >= 3 ? c : 0]) / 255;
    }
    out->alpha[p] = has_alpha ? static_cast<float>(pixel[channels - 1]) / 255 : 1.0f;
  }
  if (has_alpha) out->mask = "its alpha channel";
}

}  // namespace

Result<ViewPixels> LoadViewPixels(const TransformsFrame& frame) {
  TILEGRAD_ASSIGN(const ImageU8 image, LoadTarget(frame));
  ViewPixels out;
  TakeImage(image, &out);
  if (!frame.mask.empty()) TILEGRAD_TRY(TakeMask(frame.mask, &out));
  return out;
}

}  // namespace tilegrad::train
