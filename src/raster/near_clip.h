// SPDX-License-Identifier: Apache-2.0
// Near clipping (conventions.h, rule 6): of the faces of a ScreenMesh and their attributes, forward
// and backward. Scalar templates, used by the reference and, since cut faces are rare, by the fast
// path too.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>

#include "base/scalar.h"
#include "raster/attributes.h"
#include "raster/coverage.h"
#include "raster/screen_mesh.h"
#include "scene/camera.h"

namespace tilegrad::raster {

// A point in camera space; depth = -z.
template <class T>
struct CameraPoint {
  T x, y, depth;
};

template <class T>
CameraPoint<T> ToCamera(const CameraT<T>& camera, const T* p) {
  const T* r = camera.rotation;
  const T* t = camera.translation;
  return {r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + t[0],
          r[3] * p[0] + r[4] * p[1] + r[5] * p[2] + t[1],
          -(r[6] * p[0] + r[7] * p[1] + r[8] * p[2] + t[2])};
}

// The geometry from which the faces of a screen mesh are assembled.
template <class T>
struct FaceSource {
  std::span<const T> positions;         // [V,3]
  std::span<const std::int32_t> faces;  // [F,3]
  const CameraT<T>* camera;
  bool cull_back = false;
  const FaceCorners* corners = nullptr;  // of `faces`, if already split by corner
};

template <class T>
bool IsVisibleDepth(const T& depth, const CameraT<T>& camera) {
  return RealPart(depth) >= RealPart(camera.near_plane);
}

// Appends the vertex where the edge from a (visible) to b (hidden) meets the near plane.
template <class T>
std::int32_t AppendClipVertex(const FaceSource<T>& source, std::int32_t a, std::int32_t b,
                              ScreenMeshBuffersT<T>* out) {
  const CameraT<T>& camera = *source.camera;
  const CameraPoint<T> pa = ToCamera(camera, &source.positions[3 * static_cast<std::size_t>(a)]);
  const CameraPoint<T> pb = ToCamera(camera, &source.positions[3 * static_cast<std::size_t>(b)]);
  const T t = (camera.near_plane - pa.depth) / (pb.depth - pa.depth);
  const T x = pa.x + t * (pb.x - pa.x), y = pa.y + t * (pb.y - pa.y);
  const T inverse_depth = T(1) / camera.near_plane;
  out->x.push_back(camera.cx + camera.fx * x * inverse_depth);
  out->y.push_back(camera.cy - camera.fy * y * inverse_depth);
  out->depth.push_back(camera.near_plane);
  out->inverse_depth.push_back(inverse_depth);
  out->clipped.push_back({a, b, t});
  return static_cast<std::int32_t>(out->x.size() - 1);
}

template <class T>
bool HasOverflow(const ScreenMeshBuffersT<T>& mesh, const std::int32_t v[3]) {
  for (int k = 0; k < 3; ++k) {
    const auto i = static_cast<std::size_t>(v[k]);
    // x - x is NaN if x is not finite.
    const auto zero = (RealPart(mesh.x[i]) - RealPart(mesh.x[i])) +
                      (RealPart(mesh.y[i]) - RealPart(mesh.y[i])) +
                      (RealPart(mesh.depth[i]) - RealPart(mesh.depth[i]));
    if (!(zero == 0)) return true;
  }
  return false;
}

// Appends a face whose corners are all visible (or, with `reject`, one that is not drawn).
template <class T>
void AppendFace(const FaceSource<T>& source, std::int32_t source_face, std::int32_t a,
                std::int32_t b, std::int32_t c, std::uint8_t reject, ScreenMeshBuffersT<T>* out) {
  const std::size_t face = out->v0.size();
  out->v0.push_back(a);
  out->v1.push_back(b);
  out->v2.push_back(c);
  out->source_face.push_back(source_face);
  const std::int32_t v[3] = {a, b, c};
  if (HasOverflow(*out, v)) reject |= kFaceOverflow;
  if (reject == 0) reject = ShapeReject(SnapFace(out->View(), face), source.cull_back);
  out->reject.push_back(reject);
}

// Rotates a quadrilateral to start at the one of its two original corners that comes first by x,
// then y, then z. Whatever the first corners and windings of coinciding faces, they then get the
// same pieces, and the tie rule decides between them. Compares positions as given, not those on the
// screen, which float and double round differently.
template <class T>
void StartAtFirstCorner(const FaceSource<T>& source, std::int32_t (&polygon)[4]) {
  const auto key = [&](std::int32_t v) {
    const T* p = &source.positions[3 * static_cast<std::size_t>(v)];
    return std::tuple(RealPart(p[0]), RealPart(p[1]), RealPart(p[2]));
  };
  const auto vertices = static_cast<std::int32_t>(source.positions.size() / 3);
  std::int32_t* first = nullptr;
  for (std::int32_t& v : polygon) {
    if (v < vertices && (first == nullptr || key(v) < key(*first))) first = &v;
  }
  std::rotate(polygon, first, polygon + 4);
}

// Appends a piece of a cut face, starting at the face's first corner or, failing that, at a vertex
// made by clipping. Kernels compute the weight of a piece's first corner as 1 minus the others,
// which loses the digits of a small weight: that of the face's first corner is not an output, and
// on the near plane weights are large.
template <class T>
void AppendPiece(const FaceSource<T>& source, std::int32_t face,
                 std::array<std::int32_t, 3> corners, ScreenMeshBuffersT<T>* out) {
  const auto vertices = static_cast<std::int32_t>(source.positions.size() / 3);
  auto start =
      std::find(corners.begin(), corners.end(), source.faces[3 * static_cast<std::size_t>(face)]);
  if (start == corners.end()) {
    start =
        std::find_if(corners.begin(), corners.end(), [&](std::int32_t v) { return v >= vertices; });
  }
  std::rotate(corners.begin(), start, corners.end());
  AppendFace(source, face, corners[0], corners[1], corners[2], 0, out);
}

// Appends what remains of a face with one or two hidden corners: a triangle or a quadrilateral.
template <class T>
void AppendCutFace(const FaceSource<T>& source, std::int32_t face, ScreenMeshBuffersT<T>* out) {
  std::int32_t polygon[4];
  int n = 0;
  for (int k = 0; k < 3; ++k) {
    const auto at = 3 * static_cast<std::size_t>(face);
    const std::int32_t a = source.faces[at + static_cast<std::size_t>(k)];
    const std::int32_t b = source.faces[at + static_cast<std::size_t>((k + 1) % 3)];
    const bool a_in = IsVisibleDepth(out->depth[static_cast<std::size_t>(a)], *source.camera);
    const bool b_in = IsVisibleDepth(out->depth[static_cast<std::size_t>(b)], *source.camera);
    if (a_in) polygon[n++] = a;
    if (a_in && !b_in) polygon[n++] = AppendClipVertex(source, a, b, out);
    if (!a_in && b_in) polygon[n++] = AppendClipVertex(source, b, a, out);
  }
  if (n == 4) StartAtFirstCorner(source, polygon);
  for (int k = 2; k < n; ++k) {
    AppendPiece(source, face, {polygon[0], polygon[k - 1], polygon[k]}, out);
  }
}

// Fills the face arrays of `out`, whose vertex arrays hold the projected source vertices, and
// appends the vertices made by clipping.
template <class T>
void AssembleFaces(const FaceSource<T>& source, ScreenMeshBuffersT<T>* out) {
  out->whole = nullptr;
  out->v0.clear();
  out->v1.clear();
  out->v2.clear();
  out->source_face.clear();
  out->reject.clear();
  out->clipped.clear();
  for (std::size_t f = 0; f < source.faces.size() / 3; ++f) {
    const std::int32_t* v = &source.faces[3 * f];
    const auto id = static_cast<std::int32_t>(f);
    int visible = 0;
    for (int k = 0; k < 3; ++k) {
      visible += IsVisibleDepth(out->depth[static_cast<std::size_t>(v[k])], *source.camera);
    }
    if (visible == 3) AppendFace(source, id, v[0], v[1], v[2], kFaceDrawn, out);
    if (visible == 0) AppendFace(source, id, v[0], v[1], v[2], kFaceBehind, out);
    if (visible == 1 || visible == 2) AppendCutFace(source, id, out);
  }
}

// The corner index of a source vertex in a source face.
inline std::size_t SourceCorner(std::span<const std::int32_t> faces, std::int32_t face,
                                std::int32_t vertex) {
  const std::int32_t* v = &faces[3 * static_cast<std::size_t>(face)];
  return v[0] == vertex ? 0 : v[1] == vertex ? 1 : 2;
}

// Vertex v of face f as a mixture of rows a and b of the source's attributes.
template <class T>
struct SourceRows {
  std::size_t a, b;
  T t;
};

template <class T>
SourceRows<T> VertexRows(const ScreenMeshT<T>& mesh, std::size_t v) {
  const auto sources = static_cast<std::size_t>(mesh.source_vertices);
  if (v < sources) return {v, v, T(0)};
  const ClipVertexT<T>& clip = mesh.clipped[v - sources];
  return {static_cast<std::size_t>(clip.a), static_cast<std::size_t>(clip.b), clip.t};
}

template <class T>
SourceRows<T> CornerRows(const ScreenMeshT<T>& mesh, std::span<const std::int32_t> faces,
                         std::size_t f, int k) {
  const SourceRows<T> v = VertexRows(mesh, static_cast<std::size_t>(mesh.vertex(f, k)));
  const std::int32_t source = mesh.source_face[f];
  const std::size_t first = 3 * static_cast<std::size_t>(source);
  return {first + SourceCorner(faces, source, static_cast<std::int32_t>(v.a)),
          first + SourceCorner(faces, source, static_cast<std::int32_t>(v.b)), v.t};
}

// Calls visit(row, source_rows, clip_index) for each row of attributes in the mesh's layout;
// clip_index selects ScreenGradients::d_clip_t, or is -1.
template <class T, class Visit>
void ForEachAttributeRow(const ScreenMeshT<T>& mesh, std::span<const std::int32_t> faces, Rate rate,
                         const Visit& visit) {
  const auto clip_index = [&](std::size_t v) {
    return static_cast<std::ptrdiff_t>(v) - mesh.source_vertices;
  };
  if (rate == Rate::kVertex) {
    for (std::size_t v = 0; v < mesh.vertices(); ++v) {
      visit(v, VertexRows(mesh, v), clip_index(v));
    }
    return;
  }
  for (std::size_t f = 0; f < mesh.faces(); ++f) {
    for (int k = 0; k < 3; ++k) {
      visit(3 * f + static_cast<std::size_t>(k), CornerRows(mesh, faces, f, k),
            clip_index(static_cast<std::size_t>(mesh.vertex(f, k))));
    }
  }
}

template <class T>
std::size_t AttributeRows(const ScreenMeshT<T>& mesh, Rate rate) {
  return rate == Rate::kVertex ? mesh.vertices() : 3 * mesh.faces();
}

// out [rows,C] <- attributes of the source mesh, in the layout of the cut mesh.
template <class T>
void ClipAttributes(const ScreenMeshT<T>& mesh, std::span<const std::int32_t> faces,
                    const AttributeViewT<const T>& in, std::span<T> out) {
  const auto channels = static_cast<std::size_t>(in.channels);
  if (channels == 0) return;  // the spans are empty
  ForEachAttributeRow(mesh, faces, in.rate,
                      [&](std::size_t row, const SourceRows<T>& from, std::ptrdiff_t) {
                        const T* a = &in.values[from.a * channels];
                        const T* b = &in.values[from.b * channels];
                        T* to = &out[row * channels];
                        for (std::size_t c = 0; c < channels; ++c) {
                          to[c] = a[c] + from.t * (b[c] - a[c]);
                        }
                      });
}

// The adjoint of ClipAttributes: d_in += ..., d_clip_t += ... . `in` are the source's attributes;
// d_in or d_clip_t may be empty.
template <class T>
void ClipAttributesBackward(const ScreenMeshT<T>& mesh, std::span<const std::int32_t> faces,
                            const AttributeViewT<const T>& in, std::span<const T> d_out,
                            std::span<T> d_in, std::span<T> d_clip_t) {
  const auto channels = static_cast<std::size_t>(in.channels);
  ForEachAttributeRow(
      mesh, faces, in.rate, [&](std::size_t row, const SourceRows<T>& from, std::ptrdiff_t clip) {
        for (std::size_t c = 0; c < channels; ++c) {
          const T d = d_out[row * channels + c];
          const std::size_t a = from.a * channels + c, b = from.b * channels + c;
          if (!d_in.empty()) {
            d_in[a] += (T(1) - from.t) * d;
            d_in[b] += from.t * d;
          }
          if (clip >= 0 && !d_clip_t.empty()) {
            d_clip_t[static_cast<std::size_t>(clip)] += d * (in.values[b] - in.values[a]);
          }
        }
      });
}

// Weights relative to the source face's corners, which the corners of a cut face mix.
template <class T>
void SourceWeights(const ScreenMeshT<T>& mesh, std::span<const std::int32_t> faces,
                   std::size_t face, const T w[3], T out[3]) {
  for (int k = 0; k < 3; ++k) out[k] = mesh.was_clipped() ? T(0) : w[k];
  if (!mesh.was_clipped()) return;
  const std::size_t first = 3 * static_cast<std::size_t>(mesh.source_face[face]);
  for (int k = 0; k < 3; ++k) {
    const auto rows = CornerRows(mesh, faces, face, k);
    out[rows.a - first] += (T(1) - rows.t) * w[k];
    out[rows.b - first] += rows.t * w[k];
  }
}

}  // namespace tilegrad::raster
