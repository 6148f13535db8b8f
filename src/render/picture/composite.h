// SPDX-License-Identifier: Apache-2.0
// Converts renders to 8-bit images: over a flat grey, with alpha, and several in a sheet. The only
// place that composites.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "render/engine.h"
#include "render/picture/picture.h"
#include "scene/image.h"
#include "tilegrad/renderer.h"

namespace tilegrad {

// Background greys, 0..1.
inline constexpr float kPaper = 0.88f, kWhite = 1.0f;

std::uint8_t ToByte(float unit);  // 0..1, clamped, to 0..255, rounded

// RGB over black [3,H,W] and its alpha [H,W]: bytes of 0..255 as in datasets, or floats of 0..1 as
// in networks.
template <class T>
struct PlanarRgba {
  std::span<const T> rgb, alpha;
  int width = 0, height = 0;
};

// RGB, composited over the grey.
ImageU8 OverGrey(const PlanarRgba<std::uint8_t>& image, float grey);
ImageU8 OverGrey(const PlanarRgba<float>& image, float grey);
ImageU8 OverGrey(const Picture& picture, float grey);
// Image n of a batch: colour where a face is visible, with hard edges.
ImageU8 OverGrey(const Images& images, std::size_t n, float grey);
// A picture [4][size][size], RGB over black and alpha, as people see it: over kPaper.
ImageU8 OnPaper(std::span<const std::uint8_t> planes, int size);
ImageU8 OnPaper(std::span<const float> planes, int size);

std::vector<std::uint8_t> PremultipliedPlanes(const Picture& picture);  // [4,H,W], RGB over black
ImageU8 StraightRgba(const Picture& picture);  // 4 channels; RGB is 0 where alpha is 0
ImageU8 StraightRgba(std::span<const std::uint8_t> planes, int size);  // of [4,size,size], as above

// Replicates each pixel to a square of factor x factor.
ImageU8 Enlarged(const ImageU8& image, int factor);
// Copies `image` into `sheet`, its upper left corner at (left, top); it must fit. Same channels.
void Paste(const ImageU8& image, int left, int top, ImageU8* sheet);
// RGB images of the same size in rows of `columns`, separated by a white gap.
ImageU8 TileImages(std::span<const ImageU8> images, int columns, int gap = 4);

}  // namespace tilegrad
