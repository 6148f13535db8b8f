// SPDX-License-Identifier: Apache-2.0
// The geometry of N3MR's hand-crafted gradient. It moves a face's edge along one axis; where the
// edge crosses a line of pixel centres, pixels of the line outward and inward of the crossing could
// change owner. The change of their value, divided by the distance that a corner must move for it,
// serves as a slope. Scalar, for reference and fast code alike; T: float or double.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "rivals/n3mr.h"

namespace tilegrad::rivals {

// Pixel units: l is the coordinate across lines, m the coordinate that moves.
template <class T>
struct SweepPoint {
  T l, m;
};

// An edge of a counter-clockwise face from a to b, and the third corner.
template <class T>
struct SweepEdge {
  SweepPoint<T> a, b, c;
  int outward;  // +1 or -1: along m, away from the face
};

enum class SweepAxis { kY, kX };  // the axis that moves

template <class T>
SweepEdge<T> SweepEdgeOf(const FaceCorners<T>& f, int edge, SweepAxis axis, int inner) {
  const auto point = [&](int k) {
    const T x = ToInnerPixels(f.x[k], inner), y = ToInnerPixels(f.y[k], inner);
    return axis == SweepAxis::kY ? SweepPoint<T>{x, y} : SweepPoint<T>{y, x};
  };
  SweepEdge<T> out{point(edge), point((edge + 1) % 3), point((edge + 2) % 3), 1};
  // The face lies to the left of a -> b.
  if ((out.a.l < out.b.l) == (axis == SweepAxis::kY)) out.outward = -1;
  return out;
}

// The crossing of an edge with line `line`.
template <class T>
struct SweepLine {
  int line;
  int in, out;     // pixels before and after the crossing, outward = out
  T crossing;      // along m
  T per_a, per_b;  // movement of a (b) per unit movement of the crossing; 0: it cannot
};

// The last line visited by the published loop or its repair.
template <class T>
int LastSweepLine(T last, int inner, bool floor_lines) {
  const T bounded = std::clamp(last, T(-2), T(inner - 1));
  return static_cast<int>(floor_lines ? std::floor(bounded) : bounded);  // int(): toward zero
}

// The integers beside x, which must fit into an int. Faster than std::floor, which is a call
// without SSE 4.
template <class T>
int Floor(T x) {
  const int whole = static_cast<int>(x);
  return whole - (static_cast<T>(whole) > x ? 1 : 0);
}
template <class T>
int Ceil(T x) {
  return -Floor(-x);
}

// Pixels of the face on a line, both included; may be empty.
struct InnerPixels {
  int first, last;
};

template <class T>
InnerPixels InnerPixelsOf(const SweepEdge<T>& e, const SweepLine<T>& line, int inner) {
  const T at = static_cast<T>(line.line);
  const bool beside_a = (at - e.a.l) * (at - e.c.l) < 0;
  const SweepPoint<T>&p = beside_a ? e.a : e.c, &q = beside_a ? e.c : e.b;
  const T limit = p.m + (q.m - p.m) / (q.l - p.l) * (at - p.l);
  if (!std::isfinite(limit)) return {0, -1};
  const T bounded = std::clamp(limit, T(-2), T(inner + 1));
  const int end = e.outward > 0 ? Ceil(bounded) : Floor(bounded);
  return {std::max(0, std::min(line.in, end)), std::min(inner - 1, std::max(line.in, end))};
}

// Calls visit(line) for the lines of a drawing of inner x inner that the edge crosses. Drops lines
// whose pixel `in` or `out` is off the drawing, as published.
template <class T, class Visit>
void ForSweepLines(const SweepEdge<T>& e, int inner, bool floor_lines, const Visit& visit) {
  if (e.a.l == e.b.l) return;
  const T first = std::max(std::ceil(std::min(e.a.l, e.b.l)), T(0));
  const int end = LastSweepLine(std::max(e.a.l, e.b.l), inner, floor_lines);
  if (!(first <= static_cast<T>(end))) return;
  const T slope = (e.b.m - e.a.m) / (e.b.l - e.a.l);
  for (int at = static_cast<int>(first); at <= end; ++at) {
    const T l = static_cast<T>(at), crossing = e.a.m + slope * (l - e.a.l);
    if (!(crossing > -1 && crossing < static_cast<T>(inner))) continue;
    SweepLine<T> line;
    line.line = at;
    line.crossing = crossing;
    line.in = e.outward > 0 ? Floor(crossing) : Ceil(crossing);
    line.out = line.in + e.outward;
    if (std::min(line.in, line.out) < 0 || std::max(line.in, line.out) >= inner) continue;
    line.per_a = e.b.l == l ? T(0) : (e.b.l - e.a.l) / (e.b.l - l);
    line.per_b = l == e.a.l ? T(0) : (e.b.l - e.a.l) / (l - e.a.l);
    visit(line);
  }
}

// dL/dm of the two ends of an edge.
template <class T>
struct SweepEnds {
  T a = T(0), b = T(0);
};

// A pixel at `at` on the line, whose change would reduce the loss by `gain` > 0.
template <class T>
void AddSweep(const SweepLine<T>& line, int at, T gain, T per_pixel, T eps, SweepEnds<T>* ends) {
  const T move = (static_cast<T>(at) - line.crossing) * per_pixel;
  const auto slope = [&](T per_end) {
    const T distance = per_end * move;
    return gain / (distance > 0 ? distance + eps : distance - eps);
  };
  if (line.per_a != 0) ends->a -= slope(line.per_a);
  if (line.per_b != 0) ends->b -= slope(line.per_b);
}

// Adds to d_corners [3,3] of the source of `face`. `scale`: N3mrOptions::Scale.
template <class T>
void AddSweepEnds(const N3mrFaceT<T>& face, int edge, SweepAxis axis, double scale,
                  const SweepEnds<T>& ends, T* d_corners) {
  const int c = axis == SweepAxis::kX ? 0 : 1;
  d_corners[3 * face.SourceCorner(edge) + c] += ends.a * static_cast<T>(scale);
  d_corners[3 * face.SourceCorner((edge + 1) % 3) + c] += ends.b * static_cast<T>(scale);
}

// Input of the sweep: the requested planes of the drawing, background filled in, and their
// adjoints, [channels][inner,inner].
template <class T>
struct SweepImages {
  int inner, channels;
  std::span<const T> values, d_values;
  std::span<const std::int32_t> owner;

  std::size_t Pixel(SweepAxis axis, int line, int at) const {
    const int row = axis == SweepAxis::kY ? at : line, column = axis == SweepAxis::kY ? line : at;
    return static_cast<std::size_t>(row * inner + column);
  }
  // Decrease of the loss if pixel `to` takes the value of pixel `from`. Sums over all channels at
  // once: colours and alpha together are not the sum of both alone.
  T Gain(std::size_t to, std::size_t from) const {
    T gain = T(0);
    for (int c = 0; c < channels; ++c) {
      const std::size_t plane = static_cast<std::size_t>(c) * owner.size();
      gain += (values[plane + to] - values[plane + from]) * d_values[plane + to];
    }
    return gain;
  }
};

// From N3MR's drawing (row 0 at the bottom) to the image (row 0 on top), and the adjoint. Each
// pixel of the image is a weighted mean of 2 x 2 pixels of the drawing, or one of them.

// Pixels `first` and, with weight `share`, first + 1 of a row or column of the drawing.
struct N3mrSample {
  int first;
  double share;
};

// For pixel k of an image of `size`, bilinear.
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
