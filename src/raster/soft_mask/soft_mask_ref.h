// SPDX-License-Identifier: Apache-2.0
// Alpha of one background pixel over all faces (paper, equations 5 and 6), and its adjoint. Scalar
// template: float, double, std::complex<double>.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/scalar.h"
#include "raster/screen_mesh.h"

namespace tilegrad::raster {

// Factors from pixels to NDC: x_ndc = 2 x / W.
template <class T>
struct SoftScale {
  T x, y;  // NDC per pixel
  T inverse_delta;
};

// The point of a face's boundary that is nearest to a pixel centre: on edge k, fraction tau from
// corner k to corner k+1; (rx, ry) leads from it to the pixel, in NDC.
template <class T>
struct NearestFeature {
  int edge = 0;
  T tau, rx, ry, squared_distance;
};

template <class T>
NearestFeature<T> NearestOnEdge(const ScreenMeshT<T>& mesh, std::size_t face, int k, T px, T py,
                                const SoftScale<T>& scale) {
  const auto a = static_cast<std::size_t>(mesh.vertex(face, k));
  const auto b = static_cast<std::size_t>(mesh.vertex(face, (k + 1) % 3));
  const T ex = (mesh.x[b] - mesh.x[a]) * scale.x, ey = (mesh.y[b] - mesh.y[a]) * scale.y;
  const T qx = (px - mesh.x[a]) * scale.x, qy = (py - mesh.y[a]) * scale.y;
  const T length = ex * ex + ey * ey;
  T tau = RealPart(length) > 0 ? (qx * ex + qy * ey) / length : T(0);
  if (!(RealPart(tau) > 0)) tau = T(0);
  if (RealPart(tau) > 1) tau = T(1);
  const T rx = qx - tau * ex, ry = qy - tau * ey;
  return {k, tau, rx, ry, rx * rx + ry * ry};
}

template <class T>
NearestFeature<T> NearestOnFace(const ScreenMeshT<T>& mesh, std::size_t face, T px, T py,
                                const SoftScale<T>& scale) {
  NearestFeature<T> best = NearestOnEdge(mesh, face, 0, px, py, scale);
  for (int k = 1; k < 3; ++k) {
    const NearestFeature<T> other = NearestOnEdge(mesh, face, k, px, py, scale);
    if (RealPart(other.squared_distance) < RealPart(best.squared_distance)) best = other;
  }
  return best;
}

// A = exp(-d^2 / delta), equation 5.
template <class T>
T FaceInfluence(const NearestFeature<T>& nearest, const SoftScale<T>& scale) {
  using std::exp;
  return exp(-nearest.squared_distance * scale.inverse_delta);
}

// Alpha over the listed faces.
template <class T>
T SoftAlphaRef(const ScreenMeshT<T>& mesh, std::span<const std::int32_t> faces, T px, T py,
               const SoftScale<T>& scale) {
  T outside = T(1);
  for (const std::int32_t f : faces) {
    const auto nearest = NearestOnFace(mesh, static_cast<std::size_t>(f), px, py, scale);
    outside *= T(1) - FaceInfluence(nearest, scale);
  }
  return T(1) - outside;
}

// Calls add(n, corner, d_x, d_y) for the two corners of faces[n] between which its nearest point
// lies. Differentiates the product with prefix and suffix products, without division.
template <class T, class Add>
void SoftAlphaRefBackward(const ScreenMeshT<T>& mesh, std::span<const std::int32_t> faces, T px,
                          T py, const SoftScale<T>& scale, T d_alpha, const Add& add) {
  std::vector<NearestFeature<T>> nearest;
  std::vector<T> suffix(faces.size() + 1, T(1));
  for (const std::int32_t f : faces) {
    nearest.push_back(NearestOnFace(mesh, static_cast<std::size_t>(f), px, py, scale));
  }
  for (std::size_t n = faces.size(); n-- > 0;) {
    suffix[n] = suffix[n + 1] * (T(1) - FaceInfluence(nearest[n], scale));
  }
  T prefix = T(1);
  for (std::size_t n = 0; n < faces.size(); ++n) {
    const NearestFeature<T>& at = nearest[n];
    const T influence = FaceInfluence(at, scale);
    // dA/d(d^2) = -A / delta; moving the near point by v changes d^2 by -2 r.v
    const T push = d_alpha * prefix * suffix[n + 1] * influence * scale.inverse_delta * T(2);
    const T weight[2] = {T(1) - at.tau, at.tau};
    for (int end = 0; end < 2; ++end) {
      add(n, (at.edge + end) % 3, push * weight[end] * at.rx * scale.x,
          push * weight[end] * at.ry * scale.y);
    }
    prefix *= T(1) - influence;
  }
}

}  // namespace tilegrad::raster
