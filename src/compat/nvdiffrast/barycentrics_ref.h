// SPDX-License-Identifier: Apache-2.0
// The mathematics of rasterize.h at one pixel, and its adjoint. S: double, std::complex<double>.
//
// With p_k = (x_k - X w_k, y_k - Y w_k) for the pixel centre (X, Y) in normalised device
// coordinates, the perspective-correct weights of the corners are
//
//     b_k = a_k / s,   a_k = p_i x p_j,   s = a_0 + a_1 + a_2,   (k, i, j) cyclic
//
// (homogeneous coordinates on the plane: Olano and Greer, Triangle Scan Conversion using 2D
// Homogeneous Coordinates, 1997; no division by w, so corners behind the eye are no special case).
// a_k is linear in X and Y, so its derivatives, A_k and B_k, follow from p and w.
#pragma once

#include <algorithm>

#include "base/scalar.h"
#include "compat/nvdiffrast/clip_mesh.h"

namespace tilegrad::compat::nvdiffrast {

template <class S>
struct ClipCorners {
  S x[3], y[3], z[3], w[3];
};

// Outputs of rasterize for a pixel. X and Y in pixels.
template <class S>
struct Barycentrics {
  S u, v;                        // weights of corners 0 and 1
  S depth;                       // z/w
  S du_dx, du_dy, dv_dx, dv_dy;  // per pixel
  bool solid;                    // else the face is edge-on: weights are 1/3, derivatives 0
};

// Normalised device coordinates per pixel.
struct PixelSize {
  double x, y;
};
inline PixelSize SizeOf(const PixelGrid& grid) { return {2.0 / grid.width, 2.0 / grid.height}; }

// A weight that changes by more than this between adjacent pixels belongs to a face thinner than
// 1/64 pixel. Its derivative grows without bound, so weights are taken as constant
// (raster/conventions.h, rule 8).
inline constexpr double kSteepest = 64;

namespace barycentrics_ref {

template <class S>
struct Products {
  S px[3], py[3];
  S a[3], ax[3], ay[3];  // a_k, A_k, B_k
  S sum, sum_x, sum_y;
};

template <class S>
Products<S> MakeProducts(const ClipCorners<S>& c, const PixelCentre& at) {
  Products<S> out;
  for (int k = 0; k < 3; ++k) {
    out.px[k] = c.x[k] - at.x * c.w[k];
    out.py[k] = c.y[k] - at.y * c.w[k];
  }
  out.sum = out.sum_x = out.sum_y = S(0);
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    out.a[k] = out.px[i] * out.py[j] - out.py[i] * out.px[j];
    out.ax[k] = out.py[i] * c.w[j] - c.w[i] * out.py[j];
    out.ay[k] = c.w[i] * out.px[j] - out.px[i] * c.w[j];
    out.sum += out.a[k];
    out.sum_x += out.ax[k];
    out.sum_y += out.ay[k];
  }
  return out;
}

// Whether weights with these derivatives belong to a face wide enough to have gradients.
template <class S>
bool IsSolid(const Barycentrics<S>& b) {
  const auto square = [](const S& x, const S& y) {
    return RealPart(x) * RealPart(x) + RealPart(y) * RealPart(y);
  };
  const double steepest = std::max({square(b.du_dx, b.du_dy), square(b.dv_dx, b.dv_dy),
                                    square(b.du_dx + b.dv_dx, b.du_dy + b.dv_dy)});
  return steepest <= kSteepest * kSteepest;  // false for NaN
}

}  // namespace barycentrics_ref

namespace barycentrics_ref {

// Weights of corners 0 and 1 and their derivatives, for any face.
template <class S>
Barycentrics<S> Quotients(const Products<S>& p, const PixelSize& size) {
  const S inverse = S(1) / p.sum;
  Barycentrics<S> out;
  out.u = p.a[0] * inverse;
  out.v = p.a[1] * inverse;
  out.du_dx = (p.ax[0] - out.u * p.sum_x) * inverse * size.x;
  out.du_dy = (p.ay[0] - out.u * p.sum_y) * inverse * size.y;
  out.dv_dx = (p.ax[1] - out.v * p.sum_x) * inverse * size.x;
  out.dv_dy = (p.ay[1] - out.v * p.sum_y) * inverse * size.y;
  out.solid = IsSolid(out);
  return out;
}

}  // namespace barycentrics_ref

// Not yet clamped to [0, 1]: coverage is decided at 1/1024 pixel, so a centre may lie slightly
// outside of its face.
template <class S>
Barycentrics<S> BarycentricsAt(const ClipCorners<S>& c, const PixelCentre& at,
                               const PixelSize& size) {
  auto out = barycentrics_ref::Quotients(barycentrics_ref::MakeProducts(c, at), size);
  if (!out.solid) {
    out.u = out.v = S(1) / S(3);
    out.du_dx = out.du_dy = out.dv_dx = out.dv_dy = S(0);
  }
  const S last = S(1) - out.u - out.v;
  out.depth = (out.u * c.z[0] + out.v * c.z[1] + last * c.z[2]) /
              (out.u * c.w[0] + out.v * c.w[1] + last * c.w[2]);
  return out;
}

// d_u, d_v and, in `d_slopes`, the cotangents of du_dx, du_dy, dv_dx, dv_dy.
template <class S>
struct BarycentricsCotangent {
  S d_u, d_v, d_slopes[4];
};

// d_corners.x, y, w += ...; z/w is held constant, as is the choice of the face. A face that is not
// solid contributes nothing.
template <class S>
void BarycentricsAdjoint(const ClipCorners<S>& c, const PixelCentre& at, const PixelSize& size,
                         const BarycentricsCotangent<S>& d, ClipCorners<S>* d_corners) {
  const auto p = barycentrics_ref::MakeProducts(c, at);
  const auto b = barycentrics_ref::Quotients(p, size);
  if (!b.solid) return;
  const S inverse = S(1) / p.sum;
  const S weight[2] = {b.u, b.v}, d_weight[2] = {d.d_u, d.d_v};
  const S slopes[4] = {b.du_dx, b.du_dy, b.dv_dx, b.dv_dy};
  S d_a[3] = {}, d_ax[3] = {}, d_ay[3] = {}, d_sum = S(0), d_sum_x = S(0), d_sum_y = S(0);
  for (int k = 0; k < 2; ++k) {
    const S gx = d.d_slopes[2 * k] * size.x * inverse;
    const S gy = d.d_slopes[2 * k + 1] * size.y * inverse;
    const S g = (d_weight[k] - gx * p.sum_x - gy * p.sum_y) * inverse;
    d_a[k] += g;
    d_ax[k] += gx;
    d_ay[k] += gy;
    d_sum_x -= gx * weight[k];
    d_sum_y -= gy * weight[k];
    d_sum -=
        g * weight[k] +
        (d.d_slopes[2 * k] * slopes[2 * k] + d.d_slopes[2 * k + 1] * slopes[2 * k + 1]) * inverse;
  }
  for (int k = 0; k < 3; ++k) {
    d_a[k] += d_sum;
    d_ax[k] += d_sum_x;
    d_ay[k] += d_sum_y;
  }
  S d_px[3] = {}, d_py[3] = {}, d_w[3] = {};
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    d_px[i] += d_a[k] * p.py[j] - d_ay[k] * c.w[j];
    d_py[i] += d_ax[k] * c.w[j] - d_a[k] * p.px[j];
    d_px[j] += d_ay[k] * c.w[i] - d_a[k] * p.py[i];
    d_py[j] += d_a[k] * p.px[i] - d_ax[k] * c.w[i];
    d_w[i] += d_ay[k] * p.px[j] - d_ax[k] * p.py[j];
    d_w[j] += d_ax[k] * p.py[i] - d_ay[k] * p.px[i];
  }
  for (int k = 0; k < 3; ++k) {
    d_corners->x[k] += d_px[k];
    d_corners->y[k] += d_py[k];
    d_corners->w[k] += d_w[k] - at.x * d_px[k] - at.y * d_py[k];
  }
}

}  // namespace tilegrad::compat::nvdiffrast
