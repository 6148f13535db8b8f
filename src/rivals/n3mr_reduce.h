// SPDX-License-Identifier: Apache-2.0
// From N3MR's drawing (row 0 at the bottom) to the image (row 0 on top), and the adjoint. Each
// pixel of the image is a weighted mean of 2 x 2 pixels of the drawing, or one of them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "rivals/n3mr_options.h"

namespace tilegrad::rivals {

// Pixels `first` and, with weight `share`, first + 1 of a row or column of the drawing.
struct N3mrSample {
  int first;
  double share;
};

// Of pixel k of an image of `size`, bilinear.
inline N3mrSample N3mrSampleAt(int k, int size) {
  const double at = k * (2.0 * size - 1) / (size - 1);
  const int first = std::min(static_cast<int>(at), 2 * size - 2);
  return {first, at - first};
}

// Calls visit(pixel of the image, pixel of the drawing, weight) for kNone and kBilinear.
template <class Visit>
void ForN3mrSamples(const N3mrOptions& options, int size, const Visit& visit) {
  const int inner = options.Inner(size);
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < size; ++j) {
      const auto to = static_cast<std::size_t>(i * size + j);
      if (options.reduction == N3mrReduction::kNone) {
        visit(to, static_cast<std::size_t>((size - 1 - i) * size + j), 1.0);
        continue;
      }
      const N3mrSample x = N3mrSampleAt(j, size);
      const N3mrSample y = N3mrSampleAt(size - 1 - i, size);
      for (int part = 0; part < 4; ++part) {
        const int right = part % 2, up = part / 2;
        visit(to, static_cast<std::size_t>((y.first + up) * inner + x.first + right),
              (right ? x.share : 1 - x.share) * (up ? y.share : 1 - y.share));
      }
    }
  }
}

template <class T>
void MeanOfFour(int size, std::span<const T> drawing, std::span<T> image) {
  const auto n = static_cast<std::size_t>(size);
  for (std::size_t i = 0; i < n; ++i) {
    const T* const lower = &drawing[2 * (n - 1 - i) * 2 * n];
    const T* const upper = lower + 2 * n;
    for (std::size_t j = 0; j < n; ++j) {
      image[i * n + j] =
          ((lower[2 * j] + lower[2 * j + 1]) + (upper[2 * j] + upper[2 * j + 1])) * T(0.25);
    }
  }
}

template <class T>
void MeanOfFourAdjoint(int size, std::span<const T> d_image, std::span<T> d_drawing) {
  const auto n = static_cast<std::size_t>(size);
  for (std::size_t i = 0; i < n; ++i) {
    T* const lower = &d_drawing[2 * (n - 1 - i) * 2 * n];
    T* const upper = lower + 2 * n;
    for (std::size_t j = 0; j < n; ++j) {
      const T push = d_image[i * n + j] * T(0.25);
      lower[2 * j] = lower[2 * j + 1] = upper[2 * j] = upper[2 * j + 1] = push;
    }
  }
}

// One plane: image [size,size] from drawing [inner,inner].
template <class T>
void ReduceN3mr(const N3mrOptions& options, int size, std::span<const T> drawing,
                std::span<T> image) {
  if (options.reduction == N3mrReduction::kMean) return MeanOfFour(size, drawing, image);
  std::fill(image.begin(), image.end(), T(0));
  ForN3mrSamples(options, size, [&](std::size_t to, std::size_t from, double weight) {
    image[to] += static_cast<T>(weight) * drawing[from];
  });
}

template <class T>
void ReduceN3mrAdjoint(const N3mrOptions& options, int size, std::span<const T> d_image,
                       std::span<T> d_drawing) {
  if (options.reduction == N3mrReduction::kMean) return MeanOfFourAdjoint(size, d_image, d_drawing);
  std::fill(d_drawing.begin(), d_drawing.end(), T(0));
  ForN3mrSamples(options, size, [&](std::size_t to, std::size_t from, double weight) {
    d_drawing[from] += static_cast<T>(weight) * d_image[to];
  });
}

}  // namespace tilegrad::rivals
