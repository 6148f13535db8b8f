// SPDX-License-Identifier: Apache-2.0
// N3MR's sweep over colours, or colours and alpha: the gain of each pixel of a line at once.
#pragma once

#include <cstddef>
#include <cstdint>

#include "rivals/n3mr_color.h"
#include "rivals/n3mr_sweep.h"

namespace tilegrad::rivals {

// One line of the drawing, from its first pixel: SweepImages::Gain(d, in) is
// sums[d] - sum over c of value[c] * d_value[c][d].
template <class T>
struct GainLine {
  const T* sums;
  const T* d_value[4];
  T value[4];  // 0 beyond the channels
};

// Both ends' slopes (AddSweep) of pixels [begin, end), all on one side of the crossing, which gain.
// Four side by side, for the compiler to make vectors of.
template <class T>
SweepEnds<T> SumGains(const GainLine<T>& gains, int begin, int end, const SweepLine<T>& line,
                      const SweepEnds<T>& per_pixel, const SweepEnds<T>& eps) {
  constexpr int kLanes = 4;
  T a[kLanes] = {}, b[kLanes] = {};
  const auto add = [&](int d, int lane) {
    T gain = gains.sums[d];
    for (int c = 0; c < 4; ++c) gain -= gains.value[c] * gains.d_value[c][d];
    gain = gain > 0 ? gain : T(0);
    const T away = static_cast<T>(d) - line.crossing;
    a[lane] += gain / (away * per_pixel.a + eps.a);
    b[lane] += gain / (away * per_pixel.b + eps.b);
  };
  int d = begin;
  for (; d + kLanes <= end; d += kLanes) {
    for (int lane = 0; lane < kLanes; ++lane) add(d + lane, lane);
  }
  for (; d < end; ++d) add(d, 0);
  return {(a[0] + a[2]) + (a[1] + a[3]), (b[0] + b[2]) + (b[1] + b[3])};
}

// The sweep of one face over the planes that are asked for.
template <class T>
class ColorSweep {
 public:
  ColorSweep(const N3mrColorJob<T>& job, const SweepImages<T>& swept, const N3mrPlanesT<T>& planes,
             std::int32_t f)
      : job_(job),
        swept_(swept),
        planes_(planes),
        f_(f),
        per_pixel_(T(2) / T(swept.inner)),
        eps_(static_cast<T>(job.options.eps)) {}

  void AddTo(T* d_corners) const {
    const N3mrFaceT<T>& face = job_.image.faces[static_cast<std::size_t>(f_)];
    for (int edge = 0; edge < 3; ++edge) {
      for (const SweepAxis axis : {SweepAxis::kY, SweepAxis::kX}) {
        AddSweepEnds(face, edge, axis, job_.options.Scale(job_.image.size), Ends(face, edge, axis),
                     d_corners);
      }
    }
  }

 private:
  SweepEnds<T> Ends(const N3mrFaceT<T>& face, int edge, SweepAxis axis) const {
    const SweepEdge<T> e = SweepEdgeOf(face.at, edge, axis, swept_.inner);
    SweepEnds<T> ends;
    ForSweepLines(e, swept_.inner, job_.options.floor_lines, [&](const SweepLine<T>& line) {
      const std::size_t in = swept_.Pixel(axis, line.line, line.in);
      if (swept_.owner[in] == f_) Outward(axis, e.outward, line, in, &ends);
      const std::size_t out = swept_.Pixel(axis, line.line, line.out);
      Inward(axis, line, InnerPixelsOf(e, line, swept_.inner), out, &ends);
    });
    return ends;
  }

  GainLine<T> LineAt(SweepAxis axis, int line, std::size_t in) const {
    const bool rows = axis == SweepAxis::kX;
    const std::size_t pixels = swept_.owner.size(),
                      start = static_cast<std::size_t>(line * swept_.inner);
    const T* const d_values = (rows ? swept_.d_values.data() : planes_.d_columns.data()) + start;
    GainLine<T> out{(rows ? planes_.row_sums.data() : planes_.column_sums.data()) + start, {}, {}};
    for (std::size_t c = 0; c < 4; ++c) {
      const bool there = c < static_cast<std::size_t>(swept_.channels);
      out.d_value[c] = d_values + (there ? c * pixels : 0);
      out.value[c] = there ? swept_.values[c * pixels + in] : T(0);
    }
    return out;
  }

  void Outward(SweepAxis axis, int outward, const SweepLine<T>& line, std::size_t in,
               SweepEnds<T>* ends) const {
    const int begin = outward > 0 ? line.out : 0, end = outward > 0 ? swept_.inner : line.out + 1;
    const auto eps = [&](T per_end) { return (per_end > 0) == (outward > 0) ? eps_ : -eps_; };
    const SweepEnds<T> sum = SumGains(LineAt(axis, line.line, in), begin, end, line,
                                      {line.per_a * per_pixel_, line.per_b * per_pixel_},
                                      {eps(line.per_a), eps(line.per_b)});
    if (line.per_a != 0) ends->a -= sum.a;
    if (line.per_b != 0) ends->b -= sum.b;
  }

  void Inward(SweepAxis axis, const SweepLine<T>& line, InnerPixels inside, std::size_t out,
              SweepEnds<T>* ends) const {
    for (int d = inside.first; d <= inside.last; ++d) {
      const std::size_t p = swept_.Pixel(axis, line.line, d);
      if (swept_.owner[p] != f_) continue;
      const T gain = swept_.Gain(p, out);
      if (gain > 0) AddSweep(line, d, gain, per_pixel_, eps_, ends);
    }
  }

  const N3mrColorJob<T>& job_;
  const SweepImages<T>& swept_;
  const N3mrPlanesT<T>& planes_;
  std::int32_t f_;
  T per_pixel_, eps_;
};

}  // namespace tilegrad::rivals
