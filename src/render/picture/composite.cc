// SPDX-License-Identifier: Apache-2.0
#include "render/picture/composite.h"

#include <algorithm>

#include "base/error.h"

namespace tilegrad {
namespace {

// RGB of pixel values at(pixel, channel).
template <class At>
ImageU8 RgbOf(int width, int height, const At& at) {
  ImageU8 out(width, height, 3);
  for (std::size_t p = 0; p < out.pixels.size() / 3; ++p) {
    for (std::size_t c = 0; c < 3; ++c) out.pixels[3 * p + c] = ToByte(at(p, c));
  }
  return out;
}

// 1 / scale is the unit of T.
template <class T>
PlanarRgba<T> SquarePlanes(std::span<const T> planes, int size) {
  const std::size_t rgb = planes.size() / 4 * 3;
  return {planes.first(rgb), planes.subspan(rgb), size, size};
}

template <class T>
ImageU8 PlanarOverGrey(const PlanarRgba<T>& image, float grey, float scale) {
  const std::size_t plane = image.alpha.size();
  return RgbOf(image.width, image.height, [&](std::size_t p, std::size_t c) {
    return static_cast<float>(image.rgb[c * plane + p]) / scale +
           grey * (1 - static_cast<float>(image.alpha[p]) / scale);
  });
}

}  // namespace

std::uint8_t ToByte(float unit) {
  return static_cast<std::uint8_t>(255 * std::clamp(unit, 0.0f, 1.0f) + 0.5f);
}

ImageU8 OnPaper(std::span<const std::uint8_t> planes, int size) {
  return OverGrey(SquarePlanes(planes, size), kPaper);
}

ImageU8 OnPaper(std::span<const float> planes, int size) {
  return OverGrey(SquarePlanes(planes, size), kPaper);
}

ImageU8 OverGrey(const PlanarRgba<std::uint8_t>& image, float grey) {
  return PlanarOverGrey(image, grey, 255);
}

ImageU8 OverGrey(const PlanarRgba<float>& image, float grey) {
  return PlanarOverGrey(image, grey, 1);
}

ImageU8 OverGrey(const Picture& picture, float grey) {
  const std::size_t plane = picture.alpha.size();
  return RgbOf(picture.width, picture.height, [&](std::size_t p, std::size_t c) {
    return grey + picture.alpha[p] * (picture.color[c * plane + p] - grey);
  });
}

ImageU8 OverGrey(const Images& images, std::size_t n, float grey) {
  const auto plane =
      static_cast<std::size_t>(images.width) * static_cast<std::size_t>(images.height);
  return RgbOf(images.width, images.height, [&](std::size_t p, std::size_t c) {
    return images.face_ids[n * plane + p] < 0 ? grey : images.color[(3 * n + c) * plane + p];
  });
}

std::vector<std::uint8_t> PremultipliedPlanes(const Picture& picture) {
  const std::size_t plane = picture.alpha.size();
  std::vector<std::uint8_t> out(4 * plane);
  for (std::size_t p = 0; p < plane; ++p) {
    for (std::size_t c = 0; c < 3; ++c) {
      out[c * plane + p] = ToByte(picture.alpha[p] * picture.color[c * plane + p]);
    }
    out[3 * plane + p] = ToByte(picture.alpha[p]);
  }
  return out;
}

ImageU8 StraightRgba(const Picture& picture) {
  const std::size_t plane = picture.alpha.size();
  ImageU8 out(picture.width, picture.height, 4);
  for (std::size_t p = 0; p < plane; ++p) {
    for (std::size_t c = 0; c < 3; ++c) {
      out.pixels[4 * p + c] = ToByte(picture.color[c * plane + p]);
    }
    out.pixels[4 * p + 3] = ToByte(picture.alpha[p]);
  }
  return out;
}

ImageU8 StraightRgba(std::span<const std::uint8_t> planes, int size) {
  ImageU8 out(size, size, 4);
  const std::size_t plane = planes.size() / 4;
  for (std::size_t p = 0; p < plane; ++p) {
    const int alpha = planes[3 * plane + p];
    for (std::size_t c = 0; c < 3 && alpha > 0; ++c) {
      const int value = (255 * planes[c * plane + p] + alpha / 2) / alpha;
      out.pixels[4 * p + c] = static_cast<std::uint8_t>(std::min(value, 255));
    }
    out.pixels[4 * p + 3] = static_cast<std::uint8_t>(alpha);
  }
  return out;
}

ImageU8 Enlarged(const ImageU8& image, int factor) {
  ImageU8 out(image.width * factor, image.height * factor, image.channels);
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      std::copy_n(image.at(x / factor, y / factor), image.channels, out.at(x, y));
    }
  }
  return out;
}

void Paste(const ImageU8& image, int left, int top, ImageU8* sheet) {
  for (int y = 0; y < image.height; ++y) {
    std::copy_n(image.at(0, y), image.channels * image.width, sheet->at(left, top + y));
  }
}

ImageU8 TileImages(std::span<const ImageU8> images, int columns, int gap) {
  if (images.empty()) return {};
  const int count = static_cast<int>(images.size()), across = std::min(columns, count),
            down = (count + columns - 1) / columns;
  const int step_x = images[0].width + gap, step_y = images[0].height + gap;
  ImageU8 out(across * step_x - gap, down * step_y - gap, 3, 255);
  for (int i = 0; i < count; ++i) {
    Paste(images[static_cast<std::size_t>(i)], i % columns * step_x, i / columns * step_y, &out);
  }
  return out;
}

}  // namespace tilegrad
