// SPDX-License-Identifier: Apache-2.0
// Vertices of the world to the rivals' image coordinates with our camera
// (include/tilegrad/camera.h), and the adjoint. Their own cameras mirror the image; ours does not,
// so a face that turns counter-clockwise for the camera does so on their image, too. As published
// there is no clipping: a vertex behind the camera lands mirrored.
#pragma once

#include <cstddef>
#include <span>

#include "raster/project_ref.h"
#include "rivals/face_corners.h"

namespace tilegrad::rivals {

// points: [V,3] x, y in [-1, 1] on an image of size x size, and depth. A vertex in the camera's
// plane has coordinates that are not finite, and its faces are left out.
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
    if (d[0] == T(0) && d[1] == T(0) && d[2] == T(0)) continue;  // of a left out vertex, too
    const raster::CameraPoint<T> p = raster::ToCamera(camera, &positions[v]);
    raster::CameraPoint<T> d_p{T(0), T(0), d[2]};
    raster::PerspectiveBackward(p, d[0] * per_pixel, -(d[1] * per_pixel), T(0), camera, &d_p,
                                &unwanted);
    raster::ToCameraBackward(camera, &positions[v], d_p, &d_positions[v], &unwanted);
  }
}

}  // namespace tilegrad::rivals
