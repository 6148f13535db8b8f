// SPDX-License-Identifier: Apache-2.0
#include "rivals/n3mr_color.h"

#include "base/scalar.h"
#include "rivals/n3mr_sweep.h"

namespace tilegrad::rivals {
namespace {

// One line of the drawing, from its first pixel: SweepImages::Gain(d, in) is
// sums[d] - sum over c of value[c] * d_value[c][d].
template <class T>
struct GainLine {
  const T* sums;
  const T* d_value[4];
  T value[4];  // 0 beyond the channels
};

// Both ends' slopes (AddSweep) of those pixels [begin, end) that gain, all on one side of the
// crossing. Uses four parallel sums, which the compiler vectorises.
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

// The sweep of one face over the requested planes, colours, or colours and alpha: computes the gain
// of each pixel of a line at once.
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

constexpr std::size_t kCoverage = 3;  // plane, after r, g, b

// The owner of a pixel of the drawing.
template <class T>
struct OwnPixel {
  T w[3], z;

  OwnPixel(const N3mrFaceT<T>& face, int column, int row, int inner) {
    T b[3];
    BarycentricWeights(face.at, face.area2, CentreX<T>(column, inner), -CentreY<T>(row, inner), b);
    ClippedWeights(b, w);
    z = DepthAt(face.at, w);
  }
};

template <class T>
N3mrTexels<T> TexelsOf(const N3mrColorJob<T>& job, const N3mrFaceT<T>& face,
                       const OwnPixel<T>& at) {
  return N3mrTexelsAt(face, at.w, at.z, job.colors.resolution, job.options.eps);
}

template <class T>
void ShadePixel(const N3mrColorJob<T>& job, int column, int row, N3mrPlanesT<T>* planes) {
  const std::size_t pixels = job.image.owner.size();
  const auto p = static_cast<std::size_t>(row * job.image.inner + column);
  const std::int32_t owner = job.image.owner[p];
  T color[3];
  for (int c = 0; c < 3; ++c) color[c] = static_cast<T>(job.colors.background[c]);
  planes->values[kCoverage * pixels + p] = owner < 0 ? T(0) : T(1);
  if (owner >= 0) {
    const N3mrFaceT<T>& face = job.image.faces[static_cast<std::size_t>(owner)];
    const OwnPixel<T> at(face, column, row, job.image.inner);
    const std::size_t cube = 3 * job.colors.texels() * static_cast<std::size_t>(face.source);
    MixTexels(TexelsOf(job, face, at), &job.textures[cube], color);
  }
  for (std::size_t c = 0; c < 3; ++c) planes->values[c * pixels + p] = color[c];
}

// Plane c of [channels][pixels].
template <class Array>
auto PlaneOf(Array& planes, std::size_t c, std::size_t pixels) {
  return std::span(planes).subspan(c * pixels, pixels);
}

// The planes that the sweep sums over.
template <class T>
SweepImages<T> SweptPlanes(const N3mrColorJob<T>& job, const N3mrImages<const T>& d_images,
                           const N3mrPlanesT<T>& planes) {
  const std::size_t pixels = job.image.owner.size();
  const std::size_t begin = d_images.color.empty() ? kCoverage : 0;
  const std::size_t end = d_images.alpha.empty() ? kCoverage : kCoverage + 1;
  const std::span<const T> values = planes.values, d_values = planes.d_values;
  const std::size_t first = begin * pixels, count = (end - begin) * pixels;
  return {job.image.inner, static_cast<int>(end - begin), values.subspan(first, count),
          d_values.subspan(first, count), job.image.owner};
}

// Sums and columns for ColorSweep.
template <class T>
void PrepareLines(const SweepImages<T>& swept, N3mrPlanesT<T>* planes) {
  const std::size_t pixels = swept.owner.size();
  std::fill(planes->row_sums.begin(), planes->row_sums.end(), T(0));
  for (std::size_t c = 0; c < static_cast<std::size_t>(swept.channels); ++c) {
    for (std::size_t p = 0; p < pixels; ++p) {
      planes->row_sums[p] += swept.values[c * pixels + p] * swept.d_values[c * pixels + p];
    }
  }
  const auto transpose = [&](std::span<const T> from, std::span<T> to) {
    const auto n = static_cast<std::size_t>(swept.inner);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) to[j * n + i] = from[i * n + j];
    }
  };
  transpose(planes->row_sums, planes->column_sums);
  for (std::size_t c = 0; c < static_cast<std::size_t>(swept.channels); ++c)
    transpose(PlaneOf(swept.d_values, c, pixels), PlaneOf(planes->d_columns, c, pixels));
}

// The exact adjoint of a face's texels.
template <class T>
void AddTexelAdjoints(const N3mrColorJob<T>& job, const N3mrPlanesT<T>& planes, std::int32_t f,
                      T* d_cube) {
  const N3mrFaceT<T>& face = job.image.faces[static_cast<std::size_t>(f)];
  const std::size_t pixels = job.image.owner.size();
  ForOwnPixels(job.image, f, [&](std::size_t p, int column, int row) {
    const OwnPixel<T> at(face, column, row, job.image.inner);
    const T g[3] = {planes.d_values[p], planes.d_values[pixels + p],
                    planes.d_values[2 * pixels + p]};
    MixTexelsAdjoint(TexelsOf(job, face, at), g, d_cube);
  });
}

}  // namespace

template <class T>
void ReserveN3mrPlanes(const N3mrImageT<T>& image, N3mrPlanesT<T>* planes) {
  const std::size_t pixels = image.owner.size();
  planes->values.resize(4 * pixels);
  planes->d_values.resize(4 * pixels);
  planes->row_sums.resize(pixels);
  planes->column_sums.resize(pixels);
  planes->d_columns.resize(4 * pixels);
}

template <class T>
void N3mrShade(const N3mrColorJob<T>& job, RowRange rows, N3mrPlanesT<T>* planes) {
  for (int i = rows.begin; i < rows.end; ++i) {
    for (int j = 0; j < job.image.inner; ++j) ShadePixel(job, j, i, planes);
  }
}

template <class T>
void N3mrReducePlanes(const N3mrColorJob<T>& job, const N3mrPlanesT<T>& planes,
                      const N3mrImages<T>& out) {
  const std::size_t pixels = job.image.owner.size(), plane = out.color.size() / 3;
  const auto reduce = [&](std::span<const T> from, std::span<T> to) {
    if (!to.empty()) ReduceN3mr<T>(job.options, job.image.size, from, to);
  };
  for (std::size_t c = 0; c < 3; ++c)
    reduce(PlaneOf(planes.values, c, pixels), PlaneOf(out.color, c, plane));
  reduce(PlaneOf(planes.values, kCoverage, pixels), out.alpha);
}

template <class T>
void N3mrPrepareColorBackward(const N3mrColorJob<T>& job, const N3mrImages<const T>& d_images,
                              N3mrPlanesT<T>* planes) {
  const std::size_t pixels = job.image.owner.size(), plane = d_images.color.size() / 3;
  const auto spread = [&](std::span<const T> from, std::span<T> to) {
    if (!from.empty()) ReduceN3mrAdjoint<T>(job.options, job.image.size, from, to);
  };
  for (std::size_t c = 0; c < 3; ++c)
    spread(PlaneOf(d_images.color, c, plane), PlaneOf(planes->d_values, c, pixels));
  spread(d_images.alpha, PlaneOf(planes->d_values, kCoverage, pixels));
  PrepareLines(SweptPlanes(job, d_images, *planes), planes);
}

template <class T>
void N3mrColorBackward(const N3mrColorJob<T>& job, const N3mrImages<const T>& d_images,
                       const N3mrPlanesT<T>& planes, std::size_t begin, std::size_t end,
                       const N3mrColorAdjoints<T>& out) {
  const SweepImages<T> swept = SweptPlanes(job, d_images, planes);
  const std::size_t texels = 3 * job.colors.texels();
  for (std::size_t f = begin; f < end; ++f) {
    T* const d_corners = &out.d_corners[kCornerNumbers * f];
    std::fill_n(d_corners, kCornerNumbers, T(0));
    std::fill_n(&out.d_textures[texels * f], texels, T(0));
    const std::int32_t drawn = job.image.drawn_of[f];
    if (drawn < 0 || !OwnsAPixel(job.image, drawn)) continue;
    if (!d_images.color.empty()) AddTexelAdjoints(job, planes, drawn, &out.d_textures[texels * f]);
    if (swept.channels == 0) continue;
    ColorSweep<T>(job, swept, planes, drawn).AddTo(d_corners);
  }
}

TILEGRAD_INSTANTIATE(ReserveN3mrPlanes);
TILEGRAD_INSTANTIATE(N3mrShade);
TILEGRAD_INSTANTIATE(N3mrReducePlanes);
TILEGRAD_INSTANTIATE(N3mrPrepareColorBackward);
TILEGRAD_INSTANTIATE(N3mrColorBackward);

}  // namespace tilegrad::rivals
