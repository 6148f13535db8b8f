// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "train/data/stream/textured_stream.h"

namespace tilegrad::train {
namespace {

// Of planar vectors; 0 stays.
void MakeUnit(std::size_t pixels, std::span<float> planes) {
  for (std::size_t p = 0; p < pixels; ++p) {
    double square = 0;
    for (std::size_t c = 0; c < 3; ++c)
      square += double{planes[c * pixels + p]} * double{planes[c * pixels + p]};
    if (square == 0) continue;
    const auto factor = static_cast<float>(1 / std::sqrt(square));
    for (std::size_t c = 0; c < 3; ++c) planes[c * pixels + p] *= factor;
  }
}

// Adds value(x) of the samples x of a row that show a face to their pixels: one sample of every
// pixel at a time, so that none waits for its own sum, whose order stays.
template <class Value>
void AddRow(std::size_t samples, std::span<const std::int32_t> face_ids, const Value& value,
            std::span<float> to) {
  for (std::size_t i = 0; i < samples; ++i) {
    for (std::size_t x = 0; x < to.size(); ++x) {
      const std::size_t from = x * samples + i;
      to[x] += face_ids[from] < 0 ? 0.0f : value(from);
    }
  }
}

}  // namespace

void AverageSamples(const Images& images, std::size_t n, int samples, std::span<float> to) {
  const auto width = static_cast<std::size_t>(images.width), k = static_cast<std::size_t>(samples);
  const std::size_t side = width / k, plane = width * width, pixels = side * side;
  const float share = 1.0f / static_cast<float>(samples * samples);
  const bool colors = !images.color.empty();
  const std::span<const float> values = colors ? images.color : images.normals;
  std::fill(to.begin(), to.end(), 0.0f);
  for (std::size_t y = 0; y < width; ++y) {
    const auto face_ids = images.face_ids.subspan(n * plane + y * width, width);
    const auto row = [&](std::size_t c) { return to.subspan(c * pixels + y / k * side, side); };
    for (std::size_t c = 0; c < 3; ++c) {
      const float* const of = &values[(3 * n + c) * plane + y * width];
      if (colors) {
        AddRow(
            k, face_ids, [&](std::size_t x) { return share * std::clamp(of[x], 0.0f, 1.0f); },
            row(c));
      } else {
        AddRow(
            k, face_ids, [&](std::size_t x) { return share * of[x]; }, row(c));
      }
    }
    AddRow(
        k, face_ids, [&](std::size_t) { return share; }, row(3));
  }
  if (!colors) MakeUnit(pixels, to);
}

}  // namespace tilegrad::train
