// SPDX-License-Identifier: Apache-2.0
// Attributes over the pixels of a tile, and the adjoint (paper, equations 1 to 4).
//
// Over a face, b_k is linear in the pixel position, so with m_k = 1/depth_k (or 1: screen-linear)
//
//     I_c = N_c / Q,   N_c = sum_k m_k a_kc b_k,   Q = sum_k m_k b_k     (1: screen-linear)
//
// (Q is clamped to at least LeastQ of face_plane.h: rounding in coverage lets a pixel centre lie
// slightly outside of its face, where a steep plane may cross zero)
//
// where N_c and Q are planes: three numbers per face and channel. (m is scaled so that its largest
// is 1, which changes neither I nor its gradient.) With h_c = dL/dI_c / Q and s = sum_c h_c I_c,
// the adjoint of a face needs only sums of h_c and s over its pixels, weighted by 1, x and y (their
// moments): with S_k(f) = sum over pixels of b_k f, a combination of those,
//
//     d_a_kc = m_k S_k(h_c)                  d_m_k = sum_c a_kc S_k(h_c) - S_k(s)
//     d_v_k  = -(sum_c grad N_c S_k(h_c) - grad Q S_k(s))        (weights are dragged along)
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/aligned.h"
#include "raster/attributes.h"
#include "raster/seen_faces.h"

namespace tilegrad::raster {

struct InterpolateInput {
  const ScreenMesh* mesh;
  AttributeViewT<const float> attributes;  // in the layout of the mesh
  Interpolation mode;
  bool barycentrics;  // two more planes: the weights of corners 1 and 2
};

// Channels, plus two for barycentrics if requested.
inline int InterpolateOutputs(const InterpolateInput& input) {
  return input.attributes.channels + (input.barycentrics ? 2 : 0);
}

// The planes of the visible faces, for the forward pass: four outputs of a slot are adjacent, so
// that a pixel loads what it needs of its face at once. Group 0 holds outputs 0 to 2 and Q, later
// groups four outputs each. Scratch of one worker.
class PlaneQuads {
 public:
  // For up to `slots` slots. Never shrinks.
  void Reserve(int outputs, std::size_t slots);

  int groups() const { return groups_; }
  // [slot][4], of a group: 0 the values at the slot's origin, 1 d/dx, 2 d/dy.
  float* quads(int group, int part) {
    return data_.data() + 4 * slots_ * static_cast<std::size_t>(3 * group + part);
  }
  // [slot][4]: lower bounds for group 0; only Q has one.
  float* least() { return quads(groups_, 0); }

 private:
  int groups_ = 0;
  std::size_t slots_ = 0;
  AlignedVector<float> data_;
};

// Scratch that Interpolate needs from a worker.
struct InterpolateScratch {
  SeenFaces seen;
  PlaneQuads quads;
};

// A planar image, seen from the top left pixel of a part of it. T may be const.
template <class T>
struct PlanarView {
  T* data;
  std::ptrdiff_t plane, row;  // steps
};

// The destination of Interpolate: outputs [0, channels) to `attributes`, then the two barycentrics.
// Starts at the first pixel of the rows, and writes only the first `columns` of each.
struct InterpolateOutput {
  PlanarView<float> attributes, barycentrics;
  int columns;
};

// Writes pixels of `rows`, which are kBinSize wide; 0 at background pixels.
void Interpolate(const InterpolateInput& input, const FaceRows& rows, const InterpolateOutput& out,
                 InterpolateScratch* scratch);
// The same if all pixels are background; does not read `faces` of `rows`.
void InterpolateBackground(const InterpolateInput& input, const FaceRows& rows,
                           const InterpolateOutput& out);

}  // namespace tilegrad::raster
