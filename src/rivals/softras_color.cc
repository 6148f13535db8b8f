// SPDX-License-Identifier: Apache-2.0
#include "rivals/softras_color.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "rivals/softras_color.cc"
#include <hwy/foreach_target.h>

#include "rivals/softras_color-inl.h"

#if HWY_ONCE
#include <algorithm>

namespace tilegrad::rivals {
namespace {

HWY_EXPORT(ForwardColors);
HWY_EXPORT(BackwardColors);

// Calls visit(index of a pixel's plane, index of its image) for the pixels of `rows`.
template <class Visit>
void ForPixels(const SoftRasImage& image, RowRange rows, const Visit& visit) {
  const auto size = static_cast<std::size_t>(image.size);
  for (auto i = static_cast<std::size_t>(rows.begin); i < static_cast<std::size_t>(rows.end); ++i) {
    for (std::size_t j = 0; j < size; ++j) visit(i * image.stride + j, i * size + j);
  }
}

// Initialises every pixel with the background.
void StartMixing(const SoftRasColorJob& job, RowRange rows, SoftRasColorImage* mixed) {
  const double range = job.options.far_plane - job.options.near_plane;
  const auto background =
      static_cast<float>(job.colors.BackgroundDepth() * range - job.options.far_plane);
  const std::size_t first = static_cast<std::size_t>(rows.begin) * job.image.stride;
  const std::size_t count = static_cast<std::size_t>(rows.end - rows.begin) * job.image.stride;
  const auto fill = [&](float* plane, float value) { std::fill_n(plane + first, count, value); };
  fill(mixed->nearest.data(), background);
  fill(mixed->total.data(), 1.0f);
  for (std::size_t c = 0; c < 3; ++c) {
    fill(mixed->color.data() + c * job.image.kept.size(),
         static_cast<float>(job.colors.background[c]));
  }
}

}  // namespace

void ReserveSoftRasColors(const SoftRasImage& image, SoftRasColorImage* mixed) {
  const std::size_t plane = image.kept.size();
  mixed->nearest.resize(plane);
  mixed->total.resize(plane);
  mixed->color.resize(3 * plane);
  mixed->push.resize(4 * plane);
}

void SoftRasColorForward(const SoftRasColorJob& job, RowRange rows, SoftRasColorImage* mixed,
                         std::span<float> color) {
  const SoftRasImage& image = job.image;
  const std::size_t plane = image.kept.size();
  StartMixing(job, rows, mixed);
  HWY_DYNAMIC_DISPATCH(ForwardColors)(job, rows, mixed);
  ForPixels(image, rows, [&](std::size_t at, std::size_t to) {
    for (std::size_t c = 0; c < 3; ++c) {
      float& mix = mixed->color[c * plane + at];
      mix /= mixed->total[at];
      color[c * color.size() / 3 + to] = mix;
    }
  });
}

void SoftRasColorPrepareBackward(const SoftRasImage& image, std::span<const float> d_color,
                                 SoftRasColorImage* mixed) {
  const std::size_t plane = image.kept.size(), pixels = d_color.size() / 3;
  std::fill(mixed->push.begin(), mixed->push.end(), 0.0f);  // beyond the image, too
  ForPixels(image, {0, image.size}, [&](std::size_t at, std::size_t from) {
    for (std::size_t c = 0; c < 3; ++c) {
      const float g = d_color[c * pixels + from];
      mixed->push[c * plane + at] = g;
      mixed->push[3 * plane + at] += g * mixed->color[c * plane + at];
    }
  });
}

void SoftRasColorBackward(const SoftRasColorJob& job, const SoftRasColorImage& mixed,
                          std::size_t begin, std::size_t end, const SoftRasColorAdjoints& out) {
  HWY_DYNAMIC_DISPATCH(BackwardColors)(job, mixed, begin, end, out);
}

}  // namespace tilegrad::rivals
#endif
