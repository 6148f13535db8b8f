// SPDX-License-Identifier: Apache-2.0
// Scalar reference of project.h: world to screen with near clipping, and its adjoint. T: float,
// double, std::complex<double>.
#pragma once

#include <cstddef>
#include <span>

#include "base/scalar.h"
#include "raster/near_clip.h"
#include "raster/screen_mesh.h"
#include "scene/camera.h"

namespace tilegrad::raster {

template <class T>
void ProjectVerticesRef(const FaceSource<T>& source, ScreenMeshBuffersT<T>* out) {
  const CameraT<T>& camera = *source.camera;
  const std::size_t n = source.positions.size() / 3;
  for (auto* array : {&out->x, &out->y, &out->depth, &out->inverse_depth}) array->assign(n, T(0));
  for (std::size_t v = 0; v < n; ++v) {
    const CameraPoint<T> p = ToCamera(camera, &source.positions[3 * v]);
    out->depth[v] = p.depth;
    if (!IsVisibleDepth(p.depth, camera)) continue;
    out->inverse_depth[v] = T(1) / p.depth;
    out->x[v] = camera.cx + camera.fx * p.x * out->inverse_depth[v];
    out->y[v] = camera.cy - camera.fy * p.y * out->inverse_depth[v];
  }
}

template <class T>
void ProjectRef(const FaceSource<T>& source, int width, int height, ScreenMeshBuffersT<T>* out) {
  ProjectVerticesRef(source, out);
  out->source_vertices = static_cast<std::int32_t>(source.positions.size() / 3);
  out->source_faces = static_cast<std::int32_t>(source.faces.size() / 3);
  out->width = width;
  out->height = height;
  AssembleFaces(source, out);
}

// Adjoint of one perspective division: adds to d_p and d_camera's fx, fy, cx, cy. d_x, d_y,
// d_inverse_depth: adjoints of the screen vertex.
template <class T>
void PerspectiveBackward(const CameraPoint<T>& p, T d_x, T d_y, T d_inverse_depth,
                         const CameraT<T>& camera, CameraPoint<T>* d_p, CameraT<T>* d_camera) {
  const T inverse = T(1) / p.depth;
  const T u = p.x * inverse, v = p.y * inverse;  // x = cx + fx u, y = cy - fy v
  const T d_u = camera.fx * d_x, d_v = -(camera.fy * d_y);
  d_p->x += d_u * inverse;
  d_p->y += d_v * inverse;
  d_p->depth += -(d_u * u + d_v * v + d_inverse_depth * inverse) * inverse;
  d_camera->fx += u * d_x;
  d_camera->cx += d_x;
  d_camera->fy += -(v * d_y);
  d_camera->cy += d_y;
}

// Adjoint of a vertex made by clipping.
template <class T>
struct ClipAdjoint {
  T d_x, d_y;  // of the new screen vertex
  T d_clip_t;  // of its position on the edge, from attributes
};

// Adjoint of clipping the edge from clip.a to clip.b: the new vertex has the near plane's depth
// whatever its ends do. Adds to d_points[clip.a], d_points[clip.b] and d_camera's intrinsics.
template <class T>
void ClipVertexBackward(const FaceSource<T>& source, const ClipVertexT<T>& clip,
                        const ClipAdjoint<T>& d_vertex, std::span<CameraPoint<T>> d_points,
                        CameraT<T>* d_camera) {
  const CameraT<T>& camera = *source.camera;
  const auto i = static_cast<std::size_t>(clip.a), j = static_cast<std::size_t>(clip.b);
  const CameraPoint<T> a = ToCamera(camera, &source.positions[3 * i]);
  const CameraPoint<T> b = ToCamera(camera, &source.positions[3 * j]);
  const T t = clip.t;
  const CameraPoint<T> p{a.x + t * (b.x - a.x), a.y + t * (b.y - a.y), camera.near_plane};
  CameraPoint<T> d_p{T(0), T(0), T(0)};
  PerspectiveBackward(p, d_vertex.d_x, d_vertex.d_y, T(0), camera, &d_p, d_camera);
  const T d_t = d_vertex.d_clip_t + d_p.x * (b.x - a.x) + d_p.y * (b.y - a.y);
  const T scale = d_t / (b.depth - a.depth);  // t = (near - depth_a) / (depth_b - depth_a)
  CameraPoint<T>&d_a = d_points[i], &d_b = d_points[j];
  d_a.x += (T(1) - t) * d_p.x;
  d_b.x += t * d_p.x;
  d_a.y += (T(1) - t) * d_p.y;
  d_b.y += t * d_p.y;
  d_a.depth += -((T(1) - t) * scale);
  d_b.depth += -(t * scale);
}

// Adjoint of ToCamera: adds to d_position[3] and d_camera's rotation and translation.
template <class T>
void ToCameraBackward(const CameraT<T>& camera, const T* position, const CameraPoint<T>& d_p,
                      T* d_position, CameraT<T>* d_camera) {
  const T d[3] = {d_p.x, d_p.y, -d_p.depth};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      d_position[c] += camera.rotation[3 * r + c] * d[r];
      d_camera->rotation[3 * r + c] += d[r] * position[c];
    }
    d_camera->translation[r] += d[r];
  }
}

// A camera of zeros, to add gradients to.
template <class T>
CameraT<T> ZeroCamera() {
  CameraT<T> zero;
  for (T& r : zero.rotation) r = T(0);
  zero.fx = zero.fy = zero.cx = zero.cy = zero.near_plane = T(0);
  return zero;
}

// Adds to d_positions [V,3] (may be empty) and *d_camera. d_points: V zeros, scratch.
template <class T>
void ProjectRefBackward(const FaceSource<T>& source, const ScreenMeshT<T>& mesh,
                        const ScreenGradientsT<T>& d_mesh, std::span<CameraPoint<T>> d_points,
                        std::span<T> d_positions, CameraT<T>* d_camera) {
  const CameraT<T>& camera = *source.camera;
  const auto n = static_cast<std::size_t>(mesh.source_vertices);
  const auto point = [&](std::size_t v) { return ToCamera(camera, &source.positions[3 * v]); };
  for (std::size_t v = 0; v < n; ++v) {
    const CameraPoint<T> p = point(v);
    if (!IsVisibleDepth(p.depth, camera)) continue;
    PerspectiveBackward(p, d_mesh.d_x[v], d_mesh.d_y[v], d_mesh.d_inverse_depth[v], camera,
                        &d_points[v], d_camera);
  }
  for (std::size_t i = 0; i < mesh.clipped.size(); ++i) {
    const ClipAdjoint<T> d_vertex{d_mesh.d_x[n + i], d_mesh.d_y[n + i], d_mesh.d_clip_t[i]};
    ClipVertexBackward(source, mesh.clipped[i], d_vertex, d_points, d_camera);
  }
  for (std::size_t v = 0; v < n; ++v) {
    T unwanted[3] = {T(0), T(0), T(0)};
    ToCameraBackward(camera, &source.positions[3 * v], d_points[v],
                     d_positions.empty() ? unwanted : &d_positions[3 * v], d_camera);
  }
}

}  // namespace tilegrad::raster
