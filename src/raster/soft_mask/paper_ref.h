// SPDX-License-Identifier: Apache-2.0
// The soft mask of the paper's implementations, for comparisons: a face counts only if the pixel
// lies in its box grown by `box`, and only the first `max_faces` of those, in face order. alpha can
// be far from equation 6 and depends on that order; soft_mask.h has neither fault. Scalar template:
// float, double, std::complex<double>.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "base/scalar.h"

namespace tilegrad::raster {

struct PaperSoftMask {
  double inverse_delta = 7000;  // 1 / delta of equation 5; "sigmainv"
  double box = 0.02;            // NDC; "boxlen", "expand"
  int max_faces = 30;           // "knum"
  double eps = 1e-13;           // NDC^2, added to the squared length of an edge
  double farthest = 4;          // NDC^2; larger squared distances become this
};

// Corners in NDC, y up.
template <class T>
struct NdcFace {
  T x[3] = {}, y[3] = {};
};

// A face that counts for a pixel: the nearest feature of its boundary is the point at fraction tau
// from corner `from` to corner `to` (the same one if it is a corner), and (rx, ry) leads from there
// to the pixel.
template <class T>
struct PaperCandidate {
  std::size_t face = 0;
  int from = 0, to = 0;
  T tau = T(0), rx = T(0), ry = T(0), squared_distance = T(0);
  T influence = T(0);  // A, equation 5
};

template <class T>
bool InPaperBox(const NdcFace<T>& face, const T& px, const T& py, double box) {
  const auto inside = [box](const T(&v)[3], const T& p) {
    const auto [low, high] = std::minmax({RealPart(v[0]), RealPart(v[1]), RealPart(v[2])});
    return RealPart(p) >= low - box && RealPart(p) < high + box;
  };
  return inside(face.x, px) && inside(face.y, py);
}

template <class T>
void TryPaperEdge(const NdcFace<T>& face, int k, const T& px, const T& py, double eps,
                  PaperCandidate<T>* best) {
  const int n = (k + 1) % 3;
  const T ex = face.x[n] - face.x[k], ey = face.y[n] - face.y[k];
  const T qx = px - face.x[k], qy = py - face.y[k];
  const T length = ex * ex + ey * ey + T(eps);
  const T tau = (qx * ex + qy * ey) / length;
  if (!(RealPart(tau) >= 0 && RealPart(tau) <= 1)) return;
  const T cross = qx * ey - qy * ex;
  const T d2 = cross * cross / length;
  if (!(RealPart(d2) < RealPart(best->squared_distance))) return;
  best->from = k;
  best->to = n;
  best->tau = tau;
  best->rx = cross * ey / length;
  best->ry = -cross * ex / length;
  best->squared_distance = d2;
}

template <class T>
void TryPaperCorner(const NdcFace<T>& face, int k, const T& px, const T& py,
                    PaperCandidate<T>* best) {
  const T rx = px - face.x[k], ry = py - face.y[k];
  const T d2 = rx * rx + ry * ry;
  if (!(RealPart(d2) < RealPart(best->squared_distance))) return;
  best->from = best->to = k;
  best->tau = T(0);
  best->rx = rx;
  best->ry = ry;
  best->squared_distance = d2;
}

template <class T>
std::vector<PaperCandidate<T>> PaperCandidates(std::span<const NdcFace<T>> faces, const T& px,
                                               const T& py, const PaperSoftMask& rule) {
  using std::exp;
  std::vector<PaperCandidate<T>> out;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    if (out.size() >= static_cast<std::size_t>(std::max(rule.max_faces, 0))) break;
    if (!InPaperBox(faces[f], px, py, rule.box)) continue;
    PaperCandidate<T> c;
    c.face = f;
    c.squared_distance = T(rule.farthest);
    for (int k = 0; k < 3; ++k) TryPaperEdge(faces[f], k, px, py, rule.eps, &c);
    for (int k = 0; k < 3; ++k) TryPaperCorner(faces[f], k, px, py, &c);
    c.influence = exp(-c.squared_distance * T(rule.inverse_delta));
    out.push_back(c);
  }
  return out;
}

// Alpha of a background pixel at (px, py), NDC.
template <class T>
T PaperAlphaRef(std::span<const NdcFace<T>> faces, const T& px, const T& py,
                const PaperSoftMask& rule) {
  T outside = T(1);
  for (const auto& c : PaperCandidates(faces, px, py, rule)) outside *= T(1) - c.influence;
  return T(1) - outside;
}

// Adds dL/d(corners) of the pixel to d_faces, which has the shape of faces.
template <class T>
void PaperAlphaRefBackward(std::span<const NdcFace<T>> faces, const T& px, const T& py,
                           const PaperSoftMask& rule, const T& d_alpha,
                           std::span<NdcFace<T>> d_faces) {
  const auto candidates = PaperCandidates(faces, px, py, rule);
  std::vector<T> suffix(candidates.size() + 1, T(1));  // product over the candidates after it
  for (std::size_t n = candidates.size(); n-- > 0;) {
    suffix[n] = suffix[n + 1] * (T(1) - candidates[n].influence);
  }
  T prefix = T(1);
  for (std::size_t n = 0; n < candidates.size(); ++n) {
    const PaperCandidate<T>& c = candidates[n];
    const T push = d_alpha * prefix * suffix[n + 1] * c.influence * T(rule.inverse_delta) * T(2);
    NdcFace<T>& d = d_faces[c.face];
    d.x[c.from] += push * (T(1) - c.tau) * c.rx;
    d.y[c.from] += push * (T(1) - c.tau) * c.ry;
    d.x[c.to] += push * c.tau * c.rx;
    d.y[c.to] += push * c.tau * c.ry;
    prefix *= T(1) - c.influence;
  }
}

}  // namespace tilegrad::raster
