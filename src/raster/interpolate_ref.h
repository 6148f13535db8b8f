// SPDX-License-Identifier: Apache-2.0
// Scalar reference of interpolate.h: attributes of one pixel and their adjoint (paper, equations 1
// to 4). T: float, double, std::complex<double>.
#pragma once

#include <cstddef>
#include <span>

#include "base/scalar.h"
#include "raster/attributes.h"
#include "raster/face_plane.h"
#include "raster/screen_mesh.h"

namespace tilegrad::raster {

// b: barycentric weights on the screen; w: interpolation weights. Perspective: w_k is proportional
// to b_k / depth_k, and q is the sum of those; screen-linear: w = b, q = 1.
template <class T>
struct PixelWeights {
  T b[3], w[3], q;
};

template <class T>
PixelWeights<T> PixelWeightsRef(const ScreenMeshT<T>& mesh, const FacePlane<T>& plane,
                                std::size_t face, Interpolation mode, const T& px, const T& py) {
  PixelWeights<T> out;
  const auto b = plane.Weights(px, py);
  const ScreenCorners<T> corners = CornersOf(mesh, face);
  const T least = LeastQ(plane, corners.z);
  out.q = T(0);
  for (int k = 0; k < 3; ++k) {
    out.b[k] = b[static_cast<std::size_t>(k)];
    out.w[k] = mode == Interpolation::kPerspective ? out.b[k] * corners.z[k] : out.b[k];
    out.q += out.w[k];
  }
  if (RealPart(out.q) < RealPart(least)) out.q = least;  // see interpolate.h
  if (mode == Interpolation::kScreenLinear) out.q = T(1);
  for (T& w : out.w) w /= out.q;
  return out;
}

// out[c] = sum_k w_k * attribute_k[c]
template <class T>
void InterpolateRef(const ScreenMeshT<T>& mesh, const AttributeViewT<const T>& attributes,
                    std::size_t face, const PixelWeights<T>& weights, std::span<T> out) {
  for (std::size_t c = 0; c < out.size(); ++c) {
    out[c] = T(0);
    for (int k = 0; k < 3; ++k) {
      out[c] += weights.w[k] * attributes.corner(mesh, face, k)[c];
    }
  }
}

// Moving corner m drags every weight along: db_k/dv_m = -b_m grad b_k. Adds to d_mesh.
template <class T>
void BarycentricRefBackward(const ScreenMeshT<T>& mesh, const FacePlane<T>& plane, std::size_t face,
                            const T b[3], const T d_b[3], const ScreenGradientsT<T>& d_mesh) {
  T gx = T(0), gy = T(0);
  for (int k = 0; k < 3; ++k) {
    gx += d_b[k] * plane.gx[k];
    gy += d_b[k] * plane.gy[k];
  }
  for (int m = 0; m < 3; ++m) {
    const auto v = static_cast<std::size_t>(mesh.vertex(face, m));
    d_mesh.d_x[v] -= b[m] * gx;
    d_mesh.d_y[v] -= b[m] * gy;
  }
}

// Adds the adjoint of one pixel to d_mesh and d_attributes, either of which may be empty.
template <class T>
void InterpolateRefBackward(const ScreenMeshT<T>& mesh, const AttributeViewT<const T>& attributes,
                            const FacePlane<T>& plane, std::size_t face, Interpolation mode,
                            const PixelWeights<T>& weights, std::span<const T> d_out,
                            const ScreenGradientsT<T>& d_mesh,
                            const AttributeViewT<T>& d_attributes) {
  T d_w[3] = {T(0), T(0), T(0)}, mean = T(0);
  for (int k = 0; k < 3; ++k) {
    const T* values = attributes.corner(mesh, face, k);
    for (std::size_t c = 0; c < d_out.size(); ++c) {
      d_w[k] += d_out[c] * values[c];
      if (!d_attributes.values.empty()) {
        d_attributes.corner(mesh, face, k)[c] += weights.w[k] * d_out[c];
      }
    }
    mean += weights.w[k] * d_w[k];
  }
  if (d_mesh.d_x.empty()) return;
  T d_b[3];
  for (int k = 0; k < 3; ++k) {
    d_b[k] = d_w[k];
    if (mode == Interpolation::kScreenLinear) continue;
    const auto v = static_cast<std::size_t>(mesh.vertex(face, k));
    const T d_q = (d_w[k] - mean) / weights.q;  // adjoint of b_k / depth_k
    d_mesh.d_inverse_depth[v] += d_q * weights.b[k];
    d_b[k] = d_q * mesh.inverse_depth[v];
  }
  BarycentricRefBackward(mesh, plane, face, weights.b, d_b, d_mesh);
}

}  // namespace tilegrad::raster
