// SPDX-License-Identifier: Apache-2.0
#include "rivals/softras.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "rivals/softras.cc"
#include <hwy/foreach_target.h>

#include "rivals/softras-inl.h"

#if HWY_ONCE
#include <algorithm>

namespace tilegrad::rivals {
namespace {

HWY_EXPORT(ForwardAll);
HWY_EXPORT(BackwardAll);

constexpr std::size_t kPadding = 8;  // floats: the widest vector of the kernel

// Pixels with centres that may lie in [low, high]: pixel p has its centre at (2 p + 1 - n) / n. One
// more on each side, for rounding; the kernel decides.
struct PixelRange {
  int begin, end;
  PixelRange(float low, float high, int size) {
    const auto n = static_cast<float>(size);
    const auto pixel = [&](float c) { return std::clamp((c * n + n - 1) / 2, -2.0f, n + 1); };
    begin = std::max(0, static_cast<int>(std::ceil(pixel(low))) - 1);
    end = std::min(size, static_cast<int>(std::floor(pixel(high))) + 2);
  }
};

void SetBox(float reach, int size, SoftRasFace* f) {
  f->low_x = std::min({f->x[0], f->x[1], f->x[2]}) - reach;
  f->high_x = std::max({f->x[0], f->x[1], f->x[2]}) + reach;
  const PixelRange columns(f->low_x, f->high_x, size);
  const float low_y = std::min({f->y[0], f->y[1], f->y[2]}) - reach;
  const float high_y = std::max({f->y[0], f->y[1], f->y[2]}) + reach;
  const PixelRange rows(-high_y, -low_y, size);
  f->column_begin = columns.begin;
  f->column_end = columns.end;
  f->row_begin = rows.begin;
  f->row_end = rows.end;
  // One row too many is harmless with the Euclidean distance, which has its own cut-off; the
  // barycentric one is cut by the box.
  while (f->row_begin < f->row_end && CentreY<float>(f->row_begin, size) > high_y) ++f->row_begin;
  while (f->row_begin < f->row_end && CentreY<float>(f->row_end - 1, size) < low_y) --f->row_end;
}

SoftRasFace FaceOf(const FaceCorners<float>& at, int size, const SoftRasOptions& options) {
  SoftRasFace f{};
  const float area2 = DoubledArea(at);
  if (!IsUsable(at) || !(std::abs(area2) >= static_cast<float>(kSmallestDoubledArea))) return f;
  for (int k = 0; k < 3; ++k) {
    const int next = (k + 1) % 3;
    f.x[k] = at.x[k];
    f.y[k] = at.y[k];
    f.z[k] = at.z[k];
    f.ex[k] = at.x[next] - at.x[k];
    f.ey[k] = at.y[next] - at.y[k];
    const float length = f.ex[k] * f.ex[k] + f.ey[k] * f.ey[k];
    f.inverse_length[k] = length > 0 ? 1 / length : 0;
    f.may_be_beyond |= !(at.z[k] >= static_cast<float>(options.near_plane) &&
                         at.z[k] <= static_cast<float>(options.far_plane));
  }
  f.inverse_area = 1 / area2;
  SetBox(static_cast<float>(std::sqrt(options.Cutoff())), size, &f);
  return f;
}

}  // namespace

void SetUpSoftRas(std::span<const float> corners, int size, const SoftRasOptions& options,
                  SoftRasImage* image) {
  const std::size_t faces = corners.size() / kCornerNumbers;
  image->size = size;
  image->stride = static_cast<std::size_t>(size) + kPadding;
  image->faces.resize(faces);
  image->kept.resize(static_cast<std::size_t>(size) * image->stride);
  image->push.resize(image->kept.size());
  for (std::size_t f = 0; f < faces; ++f) {
    image->faces[f] = FaceOf(CornersOf(corners.data(), f), size, options);
  }
}

void SoftRasForward(const SoftRasOptions& options, RowRange rows, SoftRasImage* image,
                    std::span<float> alpha) {
  const float start = options.alpha == SoftAlpha::kProduct ? 1.0f : 0.0f;
  const auto size = static_cast<std::size_t>(image->size);
  const auto row = [&](int i) {
    return image->kept.data() + static_cast<std::size_t>(i) * image->stride;
  };
  for (int i = rows.begin; i < rows.end; ++i) std::fill_n(row(i), image->stride, start);
  HWY_DYNAMIC_DISPATCH(ForwardAll)(options, rows, image);
  const float per_face = 1 / static_cast<float>(std::max<std::size_t>(1, image->faces.size()));
  for (int i = rows.begin; i < rows.end; ++i) {
    std::transform(row(i), row(i) + size, &alpha[static_cast<std::size_t>(i) * size],
                   [&](float kept) {
                     return options.alpha == SoftAlpha::kProduct ? 1 - kept
                            : options.alpha == SoftAlpha::kSum   ? kept * per_face
                                                                 : kept;
                   });
  }
}

void SoftRasPrepareBackward(const SoftRasOptions& options, std::span<const float> d_alpha,
                            SoftRasImage* image) {
  const auto size = static_cast<std::size_t>(image->size);
  const float per_face = 1 / static_cast<float>(std::max<std::size_t>(1, image->faces.size()));
  for (std::size_t i = 0; i < size; ++i) {
    float* const push = &image->push[i * image->stride];
    const float* const kept = &image->kept[i * image->stride];
    for (std::size_t j = 0; j < size; ++j) {
      const float factor = options.alpha == SoftAlpha::kProduct ? kept[j] : per_face;
      push[j] = d_alpha[i * size + j] * factor;
    }
    std::fill_n(push + size, kPadding, 0.0f);
  }
}

void SoftRasBackward(const SoftRasOptions& options, const SoftRasImage& image, std::size_t begin,
                     std::size_t end, std::span<float> d_corners) {
  if (options.alpha == SoftAlpha::kHard || options.distance == SoftDistance::kHard) {
    std::fill(d_corners.begin() + static_cast<std::ptrdiff_t>(kCornerNumbers * begin),
              d_corners.begin() + static_cast<std::ptrdiff_t>(kCornerNumbers * end), 0.0f);
    return;
  }
  HWY_DYNAMIC_DISPATCH(BackwardAll)(options, image, begin, end, d_corners.data());
}

}  // namespace tilegrad::rivals
#endif
