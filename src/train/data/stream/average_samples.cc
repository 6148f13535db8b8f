// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <type_traits>

#include "train/data/stream/textured_stream.h"

namespace tilegrad::train {
namespace {

// Of planar vectors; 0 stays.
void MakeUnit(std::size_t pixels, std::span<float> planes) {
  float *const x = planes.data(), *const y = x + pixels, *const z = y + pixels;
  for (std::size_t p = 0; p < pixels; ++p) {
    const double square = double{x[p]} * x[p] + double{y[p]} * y[p] + double{z[p]} * z[p];
    const auto factor = static_cast<float>(1 / std::sqrt(square > 0 ? square : 1.0));
    x[p] *= factor;
    y[p] *= factor;
    z[p] *= factor;
  }
}

// Adds value(x) of the samples x of a row that show a face to their pixels.
template <class Samples, class Value>
void AddRow(Samples samples, std::span<const std::int32_t> face_ids, const Value& value,
            std::span<float> to) {
  for (std::size_t x = 0; x < to.size(); ++x) {
    for (std::size_t i = 0; i < samples; ++i) {
      const std::size_t from = x * samples + i;
      to[x] += face_ids[from] < 0 ? 0.0f : value(from);
    }
  }
}

// Along each side of a pixel: a constant is unrolled.
template <class Samples>
void AddSamples(const Images& images, std::size_t n, Samples samples, std::span<float> to) {
  const auto width = static_cast<std::size_t>(images.width);
  const std::size_t side = width / samples, plane = width * width, pixels = side * side;
  const float share = 1.0f / static_cast<float>(samples * samples);
  const bool colors = !images.color.empty();
  const std::span<const float> values = colors ? images.color : images.normals;
  for (std::size_t y = 0; y < width; ++y) {
    const auto face_ids = images.face_ids.subspan(n * plane + y * width, width);
    const auto row = [&](std::size_t c) {
      return to.subspan(c * pixels + y / samples * side, side);
    };
    for (std::size_t c = 0; c < 3; ++c) {
      const float* const of = &values[(3 * n + c) * plane + y * width];
      const auto color = [=](std::size_t x) {
        return share * std::min(std::max(of[x], 0.0f), 1.0f);  // NaN stays
      };
      const auto normal = [=](std::size_t x) { return share * of[x]; };
      if (colors) {
        AddRow(samples, face_ids, color, row(c));
      } else {
        AddRow(samples, face_ids, normal, row(c));
      }
    }
    AddRow(
        samples, face_ids, [=](std::size_t) { return share; }, row(3));
  }
  if (!colors) MakeUnit(pixels, to);
}

}  // namespace

void AverageSamples(const Images& images, std::size_t n, int samples, std::span<float> to) {
  std::fill(to.begin(), to.end(), 0.0f);
  if (samples == 2) {
    AddSamples(images, n, std::integral_constant<std::size_t, 2>(), to);
  } else {
    AddSamples(images, n, static_cast<std::size_t>(samples), to);
  }
}

}  // namespace tilegrad::train
