// SPDX-License-Identifier: Apache-2.0
// Faces as used by the rivals of the paper's section 5.1, N3MR and SoftRas: corners on the image
// plane, separate for each face. Image coordinates are [-1, 1], x right, y up; z is the depth in
// front of the camera. Pixel centres of an image of n x n lie at x_j = (2 j + 1 - n) / n and y_i =
// (n - 1 - 2 i) / n, row 0 on top.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>

#include "base/scalar.h"
#include "raster/project_ref.h"

namespace tilegrad::rivals {

inline constexpr std::size_t kCornerNumbers = 9;  // of a face: x, y, z of three corners

template <class T>
struct FaceCorners {
  T x[3], y[3], z[3];
};

// `corners`: [F,3,3].
template <class T>
FaceCorners<T> CornersOf(const T* corners, std::size_t face) {
  const T* c = corners + kCornerNumbers * face;
  return {{c[0], c[3], c[6]}, {c[1], c[4], c[7]}, {c[2], c[5], c[8]}};
}

// Twice the signed area, positive if the corners are counter-clockwise.
template <class T>
T DoubledArea(const FaceCorners<T>& f) {
  return (f.x[1] - f.x[0]) * (f.y[2] - f.y[0]) - (f.y[1] - f.y[0]) * (f.x[2] - f.x[0]);
}

// Barycentric weights of a point of the image plane.
template <class T>
void BarycentricWeights(const FaceCorners<T>& f, const T& area2, const T& px, const T& py, T b[3]) {
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    b[k] = ((f.x[i] - px) * (f.y[j] - py) - (f.y[i] - py) * (f.x[j] - px)) / area2;
  }
}

// Weights clipped to [0, 1] and normalised to the sum 1, for interpolating depth and colours.
template <class T>
void ClippedWeights(const T b[3], T w[3]) {
  T sum = T(0);
  for (int k = 0; k < 3; ++k) {
    w[k] = RealPart(b[k]) < 0 ? T(0) : RealPart(b[k]) > 1 ? T(1) : b[k];
    sum += w[k];
  }
  for (int k = 0; k < 3; ++k) w[k] /= sum;
}

// Perspective-correct depth.
template <class T>
T DepthAt(const FaceCorners<T>& f, const T w[3]) {
  return T(1) / (w[0] / f.z[0] + w[1] / f.z[1] + w[2] / f.z[2]);
}

// Adds to d_corners [3,3] of a face, given adjoints of its barycentric weights: moving corner m by
// v changes b_k by -b_m grad b_k . v.
template <class T>
void AddBarycentricAdjoint(const FaceCorners<T>& f, const T& area2, const T b[3], const T d_b[3],
                           T* d_corners) {
  T gx = T(0), gy = T(0);
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    gx += d_b[k] * (f.y[i] - f.y[j]) / area2;
    gy += d_b[k] * (f.x[j] - f.x[i]) / area2;
  }
  for (int m = 0; m < 3; ++m) {
    d_corners[3 * m] -= b[m] * gx;
    d_corners[3 * m + 1] -= b[m] * gy;
  }
}

// False for faces with a number that is not finite, or so far off the image that squares overflow
// in float: they are skipped.
template <class T>
bool IsUsable(const FaceCorners<T>& f) {
  constexpr double kFarthest = 1e9;
  for (int k = 0; k < 3; ++k) {
    const bool usable = std::abs(RealPart(f.x[k])) <= kFarthest &&
                        std::abs(RealPart(f.y[k])) <= kFarthest && std::isfinite(RealPart(f.z[k]));
    if (!usable) return false;
  }
  return true;
}

template <class T>
T CentreX(int column, int size) {
  return T(2 * column + 1 - size) / T(size);
}
template <class T>
T CentreY(int row, int size) {
  return T(size - 1 - 2 * row) / T(size);
}

// Projects world vertices to the rivals' image coordinates with our camera
// (include/tilegrad/camera.h), and the adjoint. Their own cameras mirror the image; ours does not,
// so a face keeps its winding on the image. As published there is no clipping: a vertex behind the
// camera lands mirrored.

// points: [V,3] x, y in [-1, 1] on an image of size x size, and depth. A vertex in the camera's
// plane has coordinates that are not finite, and its faces are skipped.
template <class T>
void ProjectVertices(const CameraT<T>& camera, int size, std::span<const T> positions,
                     std::span<T> points) {
  const T per_pixel = T(2) / T(size);
  for (std::size_t v = 0; v + 2 < positions.size(); v += 3) {
    const raster::CameraPoint<T> p = raster::ToCamera(camera, &positions[v]);
    points[v] = (camera.cx + camera.fx * p.x / p.depth) * per_pixel - T(1);
    points[v + 1] = T(1) - (camera.cy - camera.fy * p.y / p.depth) * per_pixel;
    points[v + 2] = p.depth;
  }
}

// Overwrites d_positions [V,3].
template <class T>
void ProjectVerticesAdjoint(const CameraT<T>& camera, int size, std::span<const T> positions,
                            std::span<const T> d_points, std::span<T> d_positions) {
  const T per_pixel = T(2) / T(size);
  CameraT<T> unwanted = raster::ZeroCamera<T>();
  for (std::size_t v = 0; v + 2 < positions.size(); v += 3) {
    for (std::size_t c = 0; c < 3; ++c) d_positions[v + c] = T(0);
    const T* const d = &d_points[v];
    if (d[0] == T(0) && d[1] == T(0) && d[2] == T(0)) continue;  // also for skipped vertices
    const raster::CameraPoint<T> p = raster::ToCamera(camera, &positions[v]);
    raster::CameraPoint<T> d_p{T(0), T(0), d[2]};
    raster::PerspectiveBackward(p, d[0] * per_pixel, -(d[1] * per_pixel), T(0), camera, &d_p,
                                &unwanted);
    raster::ToCameraBackward(camera, &positions[v], d_p, &d_positions[v], &unwanted);
  }
}

}  // namespace tilegrad::rivals
