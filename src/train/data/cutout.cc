// SPDX-License-Identifier: Apache-2.0
#include "train/data/cutout.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "io/image_file.h"

namespace tilegrad::train {
namespace {

constexpr std::uint8_t kOpaque = 128;

// A square of the picture, in pixels; may reach beyond its edges.
struct Window {
  double x0, y0, side;
};

Result<Window> FitWindow(const ImageU8& rgba) {
  int left = rgba.width, right = -1, top = rgba.height, bottom = -1;
  std::size_t opaque = 0;
  for (int y = 0; y < rgba.height; ++y) {
    for (int x = 0; x < rgba.width; ++x) {
      if (rgba.at(x, y)[3] < kOpaque) continue;
      ++opaque;
      left = std::min(left, x);
      right = std::max(right, x);
      top = std::min(top, y);
      bottom = std::max(bottom, y);
    }
  }
  if (opaque == 0) return InvalidArgument("the mask is empty: no pixel is opaque");
  if (opaque == rgba.pixels.size() / 4)
    return InvalidArgument(
        "every pixel is opaque, so the object is not cut out; give an image with a transparent "
        "background, or a mask");
  const double side = std::max(right - left + 1, bottom - top + 1) / kTrainingFill;
  return Window{0.5 * (left + right + 1) - 0.5 * side, 0.5 * (top + bottom + 1) - 0.5 * side, side};
}

// The mean over [x0, x1) x [y0, y1) of (r a, g a, b a, a), transparent beyond the edges; by exact
// area.
struct Sum {
  double value[4] = {};
};

Sum AverageArea(const ImageU8& rgba, double x0, double y0, double side) {
  Sum sum;
  const int first_y = std::max(0, static_cast<int>(std::floor(y0))),
            last_y = std::min(rgba.height - 1, static_cast<int>(std::ceil(y0 + side)) - 1);
  const int first_x = std::max(0, static_cast<int>(std::floor(x0))),
            last_x = std::min(rgba.width - 1, static_cast<int>(std::ceil(x0 + side)) - 1);
  for (int y = first_y; y <= last_y; ++y) {
    const double height = std::min(y + 1.0, y0 + side) - std::max<double>(y, y0);
    for (int x = first_x; x <= last_x; ++x) {
      const double area = height * (std::min(x + 1.0, x0 + side) - std::max<double>(x, x0));
      const std::uint8_t* pixel = rgba.at(x, y);
      const double alpha = area * pixel[3] / 255.0;
      for (int c = 0; c < 3; ++c) sum.value[c] += alpha * pixel[c];
      sum.value[3] += 255 * alpha;
    }
  }
  for (double& v : sum.value) v /= side * side;
  return sum;
}

}  // namespace

Result<std::vector<std::uint8_t>> PrepareCutout(const ImageU8& image, int size, Framing framing) {
  const ImageU8 rgba = io::ToColor(image);
  if (rgba.channels != 4)
    return InvalidArgument(
        "the image has no alpha channel; give a cut-out with transparency, or a mask");
  TILEGRAD_ASSIGN(Window window, FitWindow(rgba));
  if (framing == Framing::kKeep) {
    const double side = std::max(rgba.width, rgba.height);
    window = {0.5 * (rgba.width - side), 0.5 * (rgba.height - side), side};
  }
  const double cell = window.side / size;
  const std::size_t plane = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  std::vector<std::uint8_t> out(4 * plane);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const Sum mean = AverageArea(rgba, window.x0 + x * cell, window.y0 + y * cell, cell);
      for (std::size_t c = 0; c < 4; ++c)
        out[c * plane + static_cast<std::size_t>(y * size + x)] =
            static_cast<std::uint8_t>(std::min(255.0, mean.value[c] + 0.5));
    }
  }
  return out;
}

std::vector<std::uint8_t> MaskValues(const ImageU8& mask) {
  const auto channels = static_cast<std::size_t>(mask.channels);
  const auto channel = [&](std::size_t c) {
    std::vector<std::uint8_t> out(mask.pixels.size() / channels);
    for (std::size_t p = 0; p < out.size(); ++p) out[p] = mask.pixels[channels * p + c];
    return out;
  };
  if (channels == 2 || channels == 4) {
    std::vector<std::uint8_t> alpha = channel(channels - 1);
    if (std::any_of(alpha.begin(), alpha.end(), [](std::uint8_t a) { return a < 255; }))
      return alpha;
  }
  return channel(0);
}

Result<ImageU8> WithMask(const ImageU8& rgb, const ImageU8& mask) {
  if (rgb.width != mask.width || rgb.height != mask.height)
    return InvalidArgument("the mask is {} x {} pixels, the image {} x {}; they must be equal",
                           mask.width, mask.height, rgb.width, rgb.height);
  ImageU8 out(rgb.width, rgb.height, 4);
  const std::vector<std::uint8_t> values = MaskValues(mask);
  for (int y = 0; y < rgb.height; ++y) {
    for (int x = 0; x < rgb.width; ++x) {
      const bool color = rgb.channels >= 3;
      for (int c = 0; c < 3; ++c) out.at(x, y)[c] = rgb.at(x, y)[color ? c : 0];
      out.at(x, y)[3] = values[static_cast<std::size_t>(y * rgb.width + x)];
    }
  }
  return out;
}

}  // namespace tilegrad::train
