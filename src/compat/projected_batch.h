// SPDX-License-Identifier: Apache-2.0
// A batch of images with faces that are already projected, and its validation. For callers that do
// their own projection, as in DIB-R's other implementations; with vertices and cameras use
// Renderer, which clips, decides coverage exactly and interpolates perspective-correctly.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/scalar.h"
#include "scene/camera.h"
#include "tilegrad/status.h"

namespace tilegrad::compat {

// Already projected faces, and their interpolation weights: the rule of DIB-R's implementations,
// which differs from conventions.h. Coordinates are NDC, x right, y up; nothing is snapped, a pixel
// centre on an edge is inside, depth and features are linear on the screen, and weights have a
// small eps in their denominator:
//
//     W_0 = (b - p) x (c - p),  W_1 = (c - p) x (a - p),  W_2 = (a - p) x (b - p),  S = sum W_k,
//     w_k = W_k / (S + sign(S) eps)
//
// Reversing an edge negates its W_k exactly, so faces that share an edge leave no crack between
// them.

template <class T>
struct ProjectedFacesT {
  std::span<const T> xy;                // [F,3,2] NDC
  std::span<const T> z;                 // [F,3] camera z: larger is nearer
  std::span<const std::uint8_t> valid;  // [F] 0: covers nothing; empty: all are valid

  std::size_t count() const { return xy.size() / 6; }
  bool is_valid(std::size_t face) const { return valid.empty() || valid[face] != 0; }
  const T* corners(std::size_t face) const { return xy.data() + 6 * face; }
};

// Twice the signed areas of the triangles from p to the edges opposite corners 0, 1, 2 of [3,2]
// corners.
template <class T>
std::array<T, 3> CornerAreas(const T* v, const T& px, const T& py) {
  const T ax = v[0] - px, ay = v[1] - py, bx = v[2] - px, by = v[3] - py;
  const T cx = v[4] - px, cy = v[5] - py;
  return {bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx};
}

// S + sign(S) eps.
template <class T>
T WeightDenominator(const T& area, const T& eps) {
  return std::signbit(RealPart(area)) ? area - eps : area + eps;
}

// w_k at p; all 0 if the face has no area.
template <class T>
std::array<T, 3> ScreenWeights(const T* corners, const T& px, const T& py, const T& eps) {
  std::array<T, 3> w = CornerAreas(corners, px, py);
  const T area = (w[0] + w[1]) + w[2];
  if (RealPart(area) == 0) return {T(0), T(0), T(0)};
  for (T& weight : w) weight /= WeightDenominator(area, eps);
  return w;
}

// N images of F faces each, views over the caller's arrays.
template <class T>
struct ProjectedBatchT {
  std::size_t images = 0, faces = 0;
  std::span<const T> xy;                // [N,F,3,2] corners, NDC: x right, y up
  std::span<const T> z;                 // [N,F,3] camera z: larger is nearer
  std::span<const std::uint8_t> valid;  // [N,F] 0: covers nothing; empty: all are valid

  ProjectedFacesT<T> image(std::size_t n) const {
    return {xy.subspan(6 * n * faces, 6 * faces),
            z.empty() ? z : z.subspan(3 * n * faces, 3 * faces),
            valid.empty() ? valid : valid.subspan(n * faces, faces)};
  }
};

inline std::size_t PixelCount(const ImageSize& size) {
  return static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height);
}

// Pixels, or other entries that show a face each, grouped by face. Index: numbers the entries.
template <class Index>
class EntriesOfFaces {
 public:
  // `face_ids` of the entries, negative where one shows none.
  template <class Id>
  EntriesOfFaces(std::span<const Id> face_ids, std::size_t faces) : begin_(faces + 1) {
    for (const Id id : face_ids) {
      if (id >= 0) ++begin_[static_cast<std::size_t>(id) + 1];
    }
    for (std::size_t f = 0; f < faces; ++f) begin_[f + 1] += begin_[f];
    entries_.resize(begin_[faces]);
    std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
    for (std::size_t i = 0; i < face_ids.size(); ++i) {
      if (face_ids[i] < 0) continue;
      entries_[next[static_cast<std::size_t>(face_ids[i])]++] = static_cast<Index>(i);
    }
  }
  // Ascending.
  std::span<const Index> of(std::size_t face) const {
    return std::span(entries_).subspan(begin_[face], begin_[face + 1] - begin_[face]);
  }

 private:
  std::vector<std::size_t> begin_;  // [F + 1]
  std::vector<Index> entries_;
};

// Checks sizes of the batch, that xy is finite, the image's size, and that face_ids [N,H,W] (unless
// empty) are in [-1, F).
template <class T>
Status ValidateProjected(const ProjectedBatchT<T>& batch, const ImageSize& size,
                         std::span<const std::int32_t> face_ids);

}  // namespace tilegrad::compat
