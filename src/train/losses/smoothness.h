// SPDX-License-Identifier: Apache-2.0
// The smoothness regulariser of section 4.1 ("flatten" in SoftRas): sum over edges of (cos(n1, n2)
// - 1)^2 with the unit normals of the two faces, mean over the batch. Boundary edges and edges of
// faces without area do not count.
#pragma once

#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "nn/tape.h"
#include "scene/topology.h"

namespace tilegrad::train {

template <class T>
using Vec3 = std::array<T, 3>;

// `inline` explicitly: GCC 12 would not inline them otherwise.
template <class T>
inline Vec3<T> Cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

template <class T>
inline T Dot(const Vec3<T>& a, const Vec3<T>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// A face's unit normal and 1 / |e1 x e2|, 0 if that is too small to divide by (the face then has no
// direction).
template <class T>
struct FaceNormal {
  Vec3<T> unit = {0, 0, 0};
  T inverse_length = 0;
};

template <class T>
inline Vec3<T> EdgeVector(std::span<const T> p, std::int32_t from, std::int32_t to) {
  return {p[3 * to] - p[3 * from], p[3 * to + 1] - p[3 * from + 1],
          p[3 * to + 2] - p[3 * from + 2]};
}

template <class T>
inline FaceNormal<T> NormalOf(std::span<const T> p, const Face& face) {
  const Vec3<T> n = Cross(EdgeVector(p, face[0], face[1]), EdgeVector(p, face[0], face[2]));
  const T length = std::sqrt(Dot(n, n));
  if (!(length > T(1e-20))) return {};
  const T inverse = 1 / length;
  return {{n[0] * inverse, n[1] * inverse, n[2] * inverse}, inverse};
}

// One mesh: p [V,3]; fills normals [F]. Sums in double.
template <class T>
double SmoothnessForward(const Topology& topology, std::span<const Face> faces,
                         std::span<const T> p, std::vector<FaceNormal<T>>& normals) {
  normals.resize(faces.size());
  for (std::size_t f = 0; f < faces.size(); ++f) normals[f] = NormalOf(p, faces[f]);
  double sum = 0;
  for (const Edge& e : topology.edges) {
    if (e.face1 < 0 || normals[e.face0].inverse_length == 0 || normals[e.face1].inverse_length == 0)
      continue;
    const auto gap = static_cast<double>(Dot(normals[e.face0].unit, normals[e.face1].unit) - 1);
    sum += gap * gap;
  }
  return sum;
}

// d_p += the adjoint of NormalOf for d_unit: with n = c / |c|, d_c = (d_unit - n (n . d_unit)) /
// |c|, then the cross product's.
template <class T>
inline void NormalBackward(std::span<const T> p, const Face& face, const FaceNormal<T>& normal,
                           const Vec3<T>& d_unit, std::span<T> d_p) {
  const T along = Dot(normal.unit, d_unit);
  Vec3<T> d_c;
  for (std::size_t c = 0; c < 3; ++c)
    d_c[c] = (d_unit[c] - normal.unit[c] * along) * normal.inverse_length;
  const Vec3<T> d_e1 = Cross(EdgeVector(p, face[0], face[2]), d_c),
                d_e2 = Cross(d_c, EdgeVector(p, face[0], face[1]));
  for (std::size_t c = 0; c < 3; ++c) {
    d_p[3 * face[1] + c] += d_e1[c];
    d_p[3 * face[2] + c] += d_e2[c];
    d_p[3 * face[0] + c] -= d_e1[c] + d_e2[c];
  }
}

// d_p = `scale` times the gradient; `normals` as SmoothnessForward filled it.
template <class T>
void SmoothnessBackward(const Topology& topology, std::span<const Face> faces, std::span<const T> p,
                        const std::vector<FaceNormal<T>>& normals, T scale, std::span<T> d_p) {
  std::vector<Vec3<T>> d_units(faces.size(), Vec3<T>{});
  for (T& d : d_p) d = 0;
  for (const Edge& e : topology.edges) {
    if (e.face1 < 0 || normals[e.face0].inverse_length == 0 || normals[e.face1].inverse_length == 0)
      continue;
    const Vec3<T>&n0 = normals[e.face0].unit, &n1 = normals[e.face1].unit;
    const T factor = 2 * scale * (Dot(n0, n1) - 1);
    for (std::size_t c = 0; c < 3; ++c) {
      d_units[e.face0][c] += factor * n1[c];
      d_units[e.face1][c] += factor * n0[c];
    }
  }
  for (std::size_t f = 0; f < faces.size(); ++f) {
    if (normals[f].inverse_length != 0) NormalBackward(p, faces[f], normals[f], d_units[f], d_p);
  }
}

// positions: [B, V, 3] of meshes that share `faces`, which `topology` describes. A scalar.
nn::Var SmoothnessLoss(const nn::Var& positions, std::span<const Face> faces,
                       const Topology& topology);

}  // namespace tilegrad::train
