// SPDX-License-Identifier: Apache-2.0
// Vector body of face_visibility.h; lanes are columns. No fused operations: the same bits on every
// instruction set.

#include <hwy/highway.h>

#include <limits>

#include "compat/kaolin/face_visibility.h"
#include "raster/conventions.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::compat::kaolin::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Pixels [column, column_end) x [row, row_end) of the image, whose centres are in a face's box.
struct FacePixels {
  std::size_t column, column_end, row, row_end;
  bool empty() const { return column >= column_end || row >= row_end; }
};

// The first of n indices for which the monotonic `holds` is true. `guess` is near it.
template <class Holds>
HWY_INLINE std::size_t FirstWhere(const Holds& holds, std::size_t n, double guess) {
  auto i = static_cast<std::size_t>(std::clamp(guess, 0.0, static_cast<double>(n)));
  while (i > 0 && holds(i - 1)) --i;
  while (i < n && !holds(i)) ++i;
  return i;
}

template <class T>
struct FaceBox {
  T left, right, bottom, top;
};

template <class T>
HWY_INLINE FaceBox<T> BoxOfFace(const T* v) {
  return {HWY_MIN(HWY_MIN(v[0], v[2]), v[4]), HWY_MAX(HWY_MAX(v[0], v[2]), v[4]),
          HWY_MIN(HWY_MIN(v[1], v[3]), v[5]), HWY_MAX(HWY_MAX(v[1], v[3]), v[5])};
}

template <class T>
HWY_INLINE std::size_t ColumnFrom(const PixelCentresT<T>& pixels, T x) {
  const double guess = (double{x} + 1) / 2 * static_cast<double>(pixels.width);
  return FirstWhere([&](std::size_t j) HWY_ATTR { return pixels.x[j] >= x; }, pixels.width, guess);
}

template <class T>
HWY_INLINE std::size_t RowBelow(const PixelCentresT<T>& pixels, T y) {
  const double guess = (1 - double{y}) / 2 * static_cast<double>(pixels.height);
  return FirstWhere([&](std::size_t i) HWY_ATTR { return pixels.y[i] < y; }, pixels.height, guess);
}

template <class T>
HWY_INLINE FacePixels PixelsOfBox(const FaceBox<T>& box, const PixelCentresT<T>& pixels,
                                  std::size_t row_begin, std::size_t row_end) {
  return {ColumnFrom(pixels, box.left), ColumnFrom(pixels, box.right),
          HWY_MAX(row_begin, RowBelow(pixels, box.top)),
          HWY_MIN(row_end, RowBelow(pixels, box.bottom))};
}

// A face whose corners, depths and id fill all lanes.
template <class D>
struct FaceInLanes {
  using V = hn::Vec<D>;
  V x[3], y[3], z[3], low, high, right, eps;
  hn::Vec<hn::RebindToSigned<D>> id;
};

// Draws the face in one vector of columns at `x` of a row at height `py`.
template <class D, class T, class Id>
HWY_INLINE void DrawColumns(D d, const FaceInLanes<D>& face, const T* x, hn::Vec<D> py, T* nearest,
                            Id* ids) {
  const hn::RebindToSigned<D> di;
  const auto px = hn::LoadU(d, x);
  hn::Vec<D> dx[3], dy[3], w[3];
  for (int k = 0; k < 3; ++k) {
    dx[k] = hn::Sub(face.x[k], px);
    dy[k] = hn::Sub(face.y[k], py);
  }
  for (int k = 0; k < 3; ++k) {
    const int a = (k + 1) % 3, b = (k + 2) % 3;
    w[k] = hn::Sub(hn::Mul(dx[a], dy[b]), hn::Mul(dy[a], dx[b]));
  }
  const auto area = hn::Add(hn::Add(w[0], w[1]), w[2]), zero = hn::Zero(d);
  const auto least = hn::Min(hn::Min(w[0], w[1]), w[2]), most = hn::Max(hn::Max(w[0], w[1]), w[2]);
  const auto one_sign = hn::Or(hn::Ge(least, zero), hn::Le(most, zero));
  const auto finite = hn::Le(hn::Abs(area), hn::Set(d, std::numeric_limits<T>::max()));
  const auto covered =
      hn::And(hn::And(one_sign, finite), hn::And(hn::Ne(area, zero), hn::Lt(px, face.right)));
  if (hn::AllFalse(d, covered)) return;
  const auto denominator = hn::Add(area, hn::CopySign(face.eps, area));
  for (auto& weight : w) weight = hn::Div(weight, denominator);
  const auto sum = hn::Add(hn::Add(hn::Mul(w[0], face.z[0]), hn::Mul(w[1], face.z[1])),
                           hn::Mul(w[2], face.z[2]));
  const auto z = hn::Min(hn::Max(sum, face.low), face.high);
  const auto old = hn::LoadU(d, nearest);
  const auto seen = hn::And(covered, hn::Gt(z, old));
  hn::StoreU(hn::IfThenElse(seen, z, old), d, nearest);
  hn::StoreU(hn::IfThenElse(hn::RebindMask(di, seen), face.id, hn::LoadU(di, ids)), di, ids);
}

template <class D, class T>
HWY_INLINE FaceInLanes<D> SpreadFace(D d, const ProjectedFacesT<T>& faces, std::size_t f, T right,
                                     T eps) {
  const hn::RebindToSigned<D> di;
  FaceInLanes<D> out;
  const OrderedFace<T> face(faces, f);
  for (std::size_t k = 0; k < 3; ++k) {
    out.x[k] = hn::Set(d, face.xy[2 * k]);
    out.y[k] = hn::Set(d, face.xy[2 * k + 1]);
    out.z[k] = hn::Set(d, face.z[k]);
  }
  out.low = hn::Set(d, face.low);
  out.high = hn::Set(d, face.high);
  out.right = hn::Set(d, right);
  out.eps = hn::Set(d, eps);
  out.id = hn::Set(di, static_cast<hn::TFromD<hn::RebindToSigned<D>>>(f));
  return out;
}

// `scratch` holds rows [row_begin, row_end), initialised with -infinity and raster::kNoFace.
template <class T>
HWY_INLINE void DrawProjectedFaces(const ProjectedFacesT<T>& faces, const PixelCentresT<T>& pixels,
                                   T eps, std::size_t row_begin, std::size_t row_end,
                                   FaceVisibilityScratchT<T>* scratch) {
  const hn::CappedTag<T, PixelCentresT<T>::kPadding> d;
  const std::size_t stride = pixels.width + PixelCentresT<T>::kPadding;
  const T band_top = pixels.y[row_begin], band_bottom = pixels.y[row_end - 1];
  for (std::size_t f = 0; f < faces.count(); ++f) {
    const FaceBox<T> box = BoxOfFace(faces.corners(f));
    if (!faces.is_valid(f) || !(box.bottom <= band_top && box.top > band_bottom)) continue;
    const FacePixels at = PixelsOfBox(box, pixels, row_begin, row_end);
    if (at.empty()) continue;
    const auto face = SpreadFace(d, faces, f, box.right, eps);
    for (std::size_t i = at.row; i < at.row_end; ++i) {
      const std::size_t row = (i - row_begin) * stride;
      const auto py = hn::Set(d, pixels.y[i]);
      for (std::size_t j = at.column; j < at.column_end; j += hn::Lanes(d)) {
        DrawColumns(d, face, pixels.x.data() + j, py, scratch->nearest.data() + row + j,
                    scratch->face.data() + row + j);
      }
    }
  }
}

void DrawProjectedFloat(const ProjectedFacesT<float>& faces, const PixelCentresT<float>& pixels,
                        float eps, std::size_t row_begin, std::size_t row_end,
                        FaceVisibilityScratchT<float>* scratch) {
  DrawProjectedFaces<float>(faces, pixels, eps, row_begin, row_end, scratch);
}

void DrawProjectedDouble(const ProjectedFacesT<double>& faces, const PixelCentresT<double>& pixels,
                         double eps, std::size_t row_begin, std::size_t row_end,
                         FaceVisibilityScratchT<double>* scratch) {
  DrawProjectedFaces<double>(faces, pixels, eps, row_begin, row_end, scratch);
}

}  // namespace tilegrad::compat::kaolin::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
