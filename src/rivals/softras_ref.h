// SPDX-License-Identifier: Apache-2.0
// Scalar reference of softras.h: every face at every pixel. T: float, double, std::complex<double>.
#pragma once

#include <algorithm>

#include "rivals/softras.h"

namespace tilegrad::rivals {

// The pixel-independent part of a face.
template <class T>
struct SoftFaceRef {
  FaceCorners<T> at;
  T area2;
  bool left_out;

  SoftFaceRef(std::span<const T> corners, std::size_t face)
      : at(CornersOf(corners.data(), face)), area2(DoubledArea(at)) {
    using std::abs;
    left_out = !IsUsable(at) || !(abs(RealPart(area2)) >= kSmallestDoubledArea);
  }
};

// A face at a pixel.
template <class T>
struct SoftFragment {
  T b[3];                             // barycentric weights
  bool inside;                        // all strictly positive
  T d = T(0);                         // signed squared distance
  T probability = T(1), miss = T(0);  // D and 1 - D
  T t[3] = {};                        // weights of the nearest point of the boundary (Euclidean)
  T rx = T(0), ry = T(0);             // from the pixel to that point
  int least = 0;                      // index of the smallest weight (barycentric)
  T w[3], z;                          // clipped weights, depth
};

// Whether the pixel is outside of the face's box by more than the root of the cut-off.
template <class T>
bool BeyondBox(const FaceCorners<T>& f, const T& px, const T& py, double reach) {
  const auto beyond = [&](const T v[3], const T& p) {
    const auto [low, high] = std::minmax({RealPart(v[0]), RealPart(v[1]), RealPart(v[2])});
    return RealPart(p) > high + reach || RealPart(p) < low - reach;
  };
  return beyond(f.x, px) || beyond(f.y, py);
}

// The nearest point of the boundary: sets t, rx, ry, d (unsigned).
template <class T>
void SetNearest(const FaceCorners<T>& f, const T& px, const T& py, SoftFragment<T>* out) {
  for (int k = 0; k < 3; ++k) {
    const int next = (k + 1) % 3;
    const T ex = f.x[next] - f.x[k], ey = f.y[next] - f.y[k];
    const T qx = px - f.x[k], qy = py - f.y[k], length = ex * ex + ey * ey;
    T t = RealPart(length) > 0 ? (qx * ex + qy * ey) / length : T(0);
    if (!(RealPart(t) > 0)) t = T(0);
    if (RealPart(t) > 1) t = T(1);
    const T rx = t * ex - qx, ry = t * ey - qy, d = rx * rx + ry * ry;
    if (k > 0 && RealPart(d) >= RealPart(out->d)) continue;
    out->d = d;
    out->rx = rx;
    out->ry = ry;
    out->t[k] = T(1) - t;
    out->t[next] = t;
    out->t[3 - k - next] = T(0);
  }
}

// sigmoid(x) and 1 - sigmoid(x), both to full relative accuracy.
template <class T>
void Sigmoid(const T& x, T* value, T* rest) {
  using std::exp;
  const bool positive = RealPart(x) > 0;
  const T e = exp(positive ? -x : x), large = T(1) / (T(1) + e), small = e / (T(1) + e);
  *value = positive ? large : small;
  *rest = positive ? small : large;
}

// False if the face does not reach the pixel. `depth` sets w and z.
template <class T>
bool MakeSoftFragment(const SoftFaceRef<T>& face, const T& px, const T& py,
                      const SoftRasOptions& options, SoftFragment<T>* out) {
  const double cutoff = options.Cutoff();
  if (face.left_out || BeyondBox(face.at, px, py, std::sqrt(cutoff))) return false;
  BarycentricWeights(face.at, face.area2, px, py, out->b);
  const auto real = [&](int k) { return RealPart(out->b[k]); };
  out->least = real(1) < real(0) ? 1 : 0;
  if (real(2) < real(out->least)) out->least = 2;
  out->inside = real(out->least) > 0;
  if (options.distance == SoftDistance::kHard) {
    if (!(real(out->least) >= 0)) return false;
  } else {
    if (options.distance == SoftDistance::kEuclidean) {
      SetNearest(face.at, px, py, out);
    } else {
      out->d = out->b[out->least] * out->b[out->least];
    }
    if (!out->inside && !(RealPart(out->d) < cutoff)) return false;
    if (!out->inside) out->d = -out->d;
    Sigmoid(T(out->d / options.sigma), &out->probability, &out->miss);
  }
  ClippedWeights(out->b, out->w);
  out->z = DepthAt(face.at, out->w);
  return true;
}

template <class T>
bool BetweenPlanes(const T& z, const SoftRasOptions& options) {
  return RealPart(z) >= options.near_plane && RealPart(z) <= options.far_plane;
}

// Adds to d_corners [3,3] of the face, given dL/dd.
template <class T>
void AddDistanceAdjoint(const SoftFaceRef<T>& face, const SoftFragment<T>& at,
                        const SoftRasOptions& options, const T& d_d, T* d_corners) {
  if (options.distance == SoftDistance::kEuclidean) {
    // The nearest point's weights are frozen (envelope theorem).
    const T push = at.inside ? T(2) * d_d : T(-2) * d_d;
    for (int k = 0; k < 3; ++k) {
      d_corners[3 * k] += push * at.t[k] * at.rx;
      d_corners[3 * k + 1] += push * at.t[k] * at.ry;
    }
  } else if (options.distance == SoftDistance::kBarycentric) {
    const T m = at.b[at.least];
    T d_b[3] = {T(0), T(0), T(0)};
    d_b[at.least] = T(2) * (RealPart(m) < 0 ? -m : m) * d_d;
    AddBarycentricAdjoint(face.at, face.area2, at.b, d_b, d_corners);
  }
}

// The per-pixel state for alpha: the product of 1 - D, the sum of D, or 1 if a face counts.
template <class T>
T KeptOf(std::span<const T> corners, const T& px, const T& py, const SoftRasOptions& options) {
  T product = T(1), sum = T(0), any = T(0);
  SoftFragment<T> at;
  for (std::size_t f = 0; f < corners.size() / kCornerNumbers; ++f) {
    if (!MakeSoftFragment(SoftFaceRef<T>(corners, f), px, py, options, &at)) continue;
    product *= at.miss;
    sum += at.probability;
    if (RealPart(at.probability) > 0.5) any = T(1);
  }
  return options.alpha == SoftAlpha::kProduct ? product
         : options.alpha == SoftAlpha::kSum   ? sum
                                              : any;
}

template <class T>
T AlphaOfKept(const T& kept, std::size_t faces, const SoftRasOptions& options) {
  if (options.alpha == SoftAlpha::kProduct) return T(1) - kept;
  return options.alpha == SoftAlpha::kSum ? kept / static_cast<double>(faces) : kept;
}

// dL/dd of a face at a pixel through alpha.
template <class T>
T AlphaToDistance(const SoftFragment<T>& at, const T& kept, std::size_t faces,
                  const SoftRasOptions& options, const T& d_alpha) {
  if (options.alpha == SoftAlpha::kHard || options.distance == SoftDistance::kHard) return T(0);
  if (!options.gradient_beyond_planes && !BetweenPlanes(at.z, options)) return T(0);
  const T per_d = at.probability / options.sigma;  // dD/dd = D (1 - D) / sigma
  if (options.alpha == SoftAlpha::kSum) {
    return d_alpha * per_d * at.miss / static_cast<double>(faces);
  }
  // prod(1 - D) / (1 - D) times 1 - D; published with a floor on the denominator.
  if (options.exact_product || RealPart(at.miss) >= kSoftFloor) return d_alpha * kept * per_d;
  return d_alpha * kept * per_d * at.miss / kSoftFloor;
}

// alpha: [size,size].
template <class T>
void SoftRasForwardRef(std::span<const T> corners, int size, const SoftRasOptions& options,
                       std::span<T> alpha) {
  const std::size_t faces = corners.size() / kCornerNumbers;
  for (std::size_t p = 0; p < alpha.size(); ++p) {
    const int i = static_cast<int>(p) / size, j = static_cast<int>(p) % size;
    alpha[p] = AlphaOfKept(KeptOf(corners, CentreX<T>(j, size), CentreY<T>(i, size), options),
                           faces, options);
  }
}

// Adds to d_corners [F,3,3].
template <class T>
void SoftRasBackwardRef(std::span<const T> corners, int size, const SoftRasOptions& options,
                        std::span<const T> d_alpha, std::span<T> d_corners) {
  const std::size_t faces = corners.size() / kCornerNumbers;
  SoftFragment<T> at;
  for (std::size_t p = 0; p < d_alpha.size(); ++p) {
    const T px = CentreX<T>(static_cast<int>(p) % size, size);
    const T py = CentreY<T>(static_cast<int>(p) / size, size);
    const T kept = KeptOf(corners, px, py, options);
    for (std::size_t f = 0; f < faces; ++f) {
      const SoftFaceRef<T> face(corners, f);
      if (!MakeSoftFragment(face, px, py, options, &at)) continue;
      const T d_d = AlphaToDistance(at, kept, faces, options, d_alpha[p]);
      AddDistanceAdjoint(face, at, options, d_d, &d_corners[kCornerNumbers * f]);
    }
  }
}

}  // namespace tilegrad::rivals
