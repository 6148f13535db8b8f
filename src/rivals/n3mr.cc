// SPDX-License-Identifier: Apache-2.0
#include "rivals/n3mr.h"

#include "base/scalar.h"
#include "rivals/n3mr_sweep.h"

namespace tilegrad::rivals {
namespace {

// Barycentric weights and 1/depth, which are affine on the image.
template <class T>
struct FacePlanes {
  T x0, y0;          // of corner 0
  T b_x[3], b_y[3];  // gradients of the weights
  T z_x, z_y, z_0;   // of 1/depth, and its value at corner 0

  explicit FacePlanes(const N3mrFaceT<T>& f) : x0(f.at.x[0]), y0(f.at.y[0]) {
    z_x = z_y = T(0);
    z_0 = T(1) / f.at.z[0];
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      b_x[k] = (f.at.y[i] - f.at.y[j]) / f.area2;
      b_y[k] = (f.at.x[j] - f.at.x[i]) / f.area2;
      z_x += b_x[k] / f.at.z[k];
      z_y += b_y[k] / f.at.z[k];
    }
  }
};

template <class T>
void DrawFace(const N3mrOptions& options, RowRange rows, std::size_t f, N3mrImageT<T>* image) {
  const N3mrFaceT<T>& face = image->faces[f];
  const FacePlanes<T> planes(face);
  const InnerRange columns(face.at.x, image->inner), box(face.at.y, image->inner);
  const T nearest = static_cast<T>(1 / options.near_plane);
  const T per_pixel = T(2) / T(image->inner), left = T(1 - image->inner) / T(image->inner);
  for (int i = std::max(rows.begin, box.begin); i < std::min(rows.end, box.end); ++i) {
    const T y = -CentreY<T>(i, image->inner) - planes.y0;
    const auto row = static_cast<std::size_t>(i * image->inner);
    for (int j = columns.begin; j < columns.end; ++j) {
      const T x = static_cast<T>(j) * per_pixel + left - planes.x0;
      const T b1 = planes.b_x[1] * x + planes.b_y[1] * y;
      const T b2 = planes.b_x[2] * x + planes.b_y[2] * y;
      const T b0 = T(1) + (planes.b_x[0] * x + planes.b_y[0] * y);
      if (!(b0 >= 0 && b1 >= 0 && b2 >= 0)) continue;
      const T inverse = planes.z_0 + (planes.z_x * x + planes.z_y * y);
      const std::size_t p = row + static_cast<std::size_t>(j);
      if (!(inverse < nearest && inverse > image->inverse_depth[p])) continue;
      image->inverse_depth[p] = inverse;
      image->owner[p] = static_cast<std::int32_t>(f);
    }
  }
}

// `line_step`, `step`: distances of lines, and of pixels on a line, in the drawing.
template <class T>
void ListPull(const N3mrImageT<T>& image, int line_step, int step, LinePixelsT<T>* out) {
  for (auto* list : {&out->at, &out->gain}) {
    list->clear();
    list->reserve(image.owner.size());  // the maximum: nothing grows later
  }
  out->first.resize(image.owner.size() + static_cast<std::size_t>(image.inner));
  auto first = out->first.begin();
  for (int line = 0; line < image.inner; ++line) {
    for (int at = 0; at < image.inner; ++at) {
      *first++ = static_cast<std::int32_t>(out->at.size());
      const auto p = static_cast<std::size_t>(line * line_step + at * step);
      if (image.owner[p] >= 0 || !(image.d_coverage[p] < 0)) continue;
      out->at.push_back(static_cast<T>(at));
      out->gain.push_back(-image.d_coverage[p]);
    }
    *first++ = static_cast<std::int32_t>(out->at.size());
  }
}

// The sum over pixels [begin, end) of a list, all on one side of the crossing, of AddSweep's slope
// for one end of an edge; `eps` has the sign of their distances. Uses eight parallel sums, which
// the compiler vectorises.
template <class T>
T SumSlopes(const LinePixelsT<T>& list, std::size_t begin, std::size_t end, T crossing, T per_pixel,
            T eps) {
  constexpr std::size_t kLanes = 8;
  const T* const at = list.at.data();
  const T* const gain = list.gain.data();
  T sums[kLanes] = {};
  std::size_t i = begin;
  for (; i + kLanes <= end; i += kLanes) {
    for (std::size_t k = 0; k < kLanes; ++k)
      sums[k] += gain[i + k] / ((at[i + k] - crossing) * per_pixel + eps);
  }
  for (; i < end; ++i) sums[0] += gain[i] / ((at[i] - crossing) * per_pixel + eps);
  return ((sums[0] + sums[4]) + (sums[2] + sums[6])) + ((sums[1] + sums[5]) + (sums[3] + sums[7]));
}

// The sweep of one face if only coverage is requested: a pixel gains by being covered if it is
// uncovered and its adjoint negative, by being uncovered in the opposite case.
template <class T>
class CoverageSweep {
 public:
  CoverageSweep(const N3mrOptions& options, const N3mrImageT<T>& image, std::int32_t f)
      : options_(options),
        image_(image),
        f_(f),
        per_pixel_(T(2) / T(image.inner)),
        eps_(static_cast<T>(options.eps)) {}

  void AddTo(T* d_corners) const {
    const N3mrFaceT<T>& face = image_.faces[static_cast<std::size_t>(f_)];
    for (int edge = 0; edge < 3; ++edge) {
      for (const SweepAxis axis : {SweepAxis::kY, SweepAxis::kX}) {
        AddSweepEnds(face, edge, axis, options_.Scale(image_.size), Ends(face, edge, axis),
                     d_corners);
      }
    }
  }

 private:
  std::size_t Pixel(SweepAxis axis, int line, int at) const {
    return static_cast<std::size_t>(axis == SweepAxis::kY ? at * image_.inner + line
                                                          : line * image_.inner + at);
  }

  SweepEnds<T> Ends(const N3mrFaceT<T>& face, int edge, SweepAxis axis) const {
    const SweepEdge<T> e = SweepEdgeOf(face.at, edge, axis, image_.inner);
    const LinePixelsT<T>& pull = axis == SweepAxis::kY ? image_.pull_columns : image_.pull_rows;
    SweepEnds<T> ends;
    ForSweepLines(e, image_.inner, options_.floor_lines, [&](const SweepLine<T>& line) {
      if (image_.owner[Pixel(axis, line.line, line.in)] == f_) {
        Outward(e.outward, line, pull, &ends);
      }
      if (image_.owner[Pixel(axis, line.line, line.out)] < 0) {
        Inward(axis, line, InnerPixelsOf(e, line, image_.inner), &ends);
      }
    });
    return ends;
  }

  void Outward(int outward, const SweepLine<T>& line, const LinePixelsT<T>& pull,
               SweepEnds<T>* ends) const {
    const int whole = outward > 0 ? image_.inner : 0, split = outward > 0 ? line.out : line.out + 1;
    const std::size_t begin = pull.Find(line.line, std::min(split, whole), image_.inner);
    const std::size_t end = pull.Find(line.line, std::max(split, whole), image_.inner);
    if (begin == end) return;
    const auto sum = [&](T per_end) {
      const T eps = (per_end > 0) == (outward > 0) ? eps_ : -eps_;
      return SumSlopes(pull, begin, end, line.crossing, per_end * per_pixel_, eps);
    };
    if (line.per_a != 0) ends->a -= sum(line.per_a);
    if (line.per_b != 0) ends->b -= sum(line.per_b);
  }

  void Inward(SweepAxis axis, const SweepLine<T>& line, InnerPixels inside,
              SweepEnds<T>* ends) const {
    for (int d = inside.first; d <= inside.last; ++d) {
      const std::size_t p = Pixel(axis, line.line, d);
      const T gain = image_.d_coverage[p];
      if (image_.owner[p] == f_ && gain > 0) AddSweep(line, d, gain, per_pixel_, eps_, ends);
    }
  }

  const N3mrOptions& options_;
  const N3mrImageT<T>& image_;
  std::int32_t f_;
  T per_pixel_, eps_;
};

}  // namespace

template <class T>
void SetUpN3mr(std::span<const T> corners, int size, const N3mrOptions& options,
               N3mrImageT<T>* image) {
  const std::size_t faces = corners.size() / kCornerNumbers;
  image->size = size;
  image->inner = options.Inner(size);
  const auto pixels =
      static_cast<std::size_t>(image->inner) * static_cast<std::size_t>(image->inner);
  image->owner.resize(pixels);
  image->inverse_depth.resize(pixels);
  image->coverage.resize(pixels);
  image->d_coverage.resize(pixels);
  image->drawn_of.assign(faces, -1);
  image->faces.clear();
  image->faces.reserve(faces);
  ForN3mrFaces(corners, options, options.Scale(size), [&](const N3mrFaceT<T>& face) {
    image->drawn_of[static_cast<std::size_t>(face.source)] =
        static_cast<std::int32_t>(image->faces.size());
    image->faces.push_back(face);
  });
}

template <class T>
void DrawN3mr(const N3mrOptions& options, RowRange rows, N3mrImageT<T>* image) {
  const auto begin = static_cast<std::ptrdiff_t>(rows.begin) * image->inner,
             end = static_cast<std::ptrdiff_t>(rows.end) * image->inner;
  std::fill(image->owner.begin() + begin, image->owner.begin() + end, -1);
  std::fill(image->inverse_depth.begin() + begin, image->inverse_depth.begin() + end,
            static_cast<T>(1 / options.far_plane));
  for (std::size_t f = 0; f < image->faces.size(); ++f) DrawFace(options, rows, f, image);
}

template <class T>
void N3mrAlpha(const N3mrOptions& options, N3mrImageT<T>* image, std::span<T> alpha) {
  std::transform(image->owner.begin(), image->owner.end(), image->coverage.begin(),
                 [](std::int32_t owner) { return owner < 0 ? T(0) : T(1); });
  ReduceN3mr<T>(options, image->size, image->coverage, alpha);
}

template <class T>
void N3mrPrepareBackward(const N3mrOptions& options, std::span<const T> d_alpha,
                         N3mrImageT<T>* image) {
  ReduceN3mrAdjoint<T>(options, image->size, d_alpha, image->d_coverage);
  ListPull(*image, image->inner, 1, &image->pull_rows);
  ListPull(*image, 1, image->inner, &image->pull_columns);
}

template <class T>
void N3mrBackward(const N3mrOptions& options, const N3mrImageT<T>& image, std::size_t begin,
                  std::size_t end, std::span<T> d_corners) {
  for (std::size_t f = begin; f < end; ++f) {
    T* const out = &d_corners[kCornerNumbers * f];
    std::fill_n(out, kCornerNumbers, T(0));
    const std::int32_t drawn = image.drawn_of[f];
    if (drawn >= 0 && OwnsAPixel(image, drawn)) CoverageSweep<T>(options, image, drawn).AddTo(out);
  }
}

TILEGRAD_INSTANTIATE(SetUpN3mr);
TILEGRAD_INSTANTIATE(DrawN3mr);
TILEGRAD_INSTANTIATE(N3mrAlpha);
TILEGRAD_INSTANTIATE(N3mrPrepareBackward);
TILEGRAD_INSTANTIATE(N3mrBackward);

}  // namespace tilegrad::rivals
