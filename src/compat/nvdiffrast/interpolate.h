// SPDX-License-Identifier: Apache-2.0
// The second of nvdiffrast's operations (rasterize.h): interpolates vertex attributes at pixels.
//
//     out_c = u a_0c + v a_1c + (1 - u - v) a_2c                 a_k: the attributes of corner k
//     out_da = (dA/dX, dA/dY) of the selected channels A, by the chain rule from rast_db
//
// Zeros where rast has no face. Attributes, u, v and rast_db have gradients. float runs vector
// kernels in float, double scalar code (interpolate_ref.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/parallel.h"
#include "compat/nvdiffrast/clip_mesh.h"
#include "tilegrad/status.h"

namespace tilegrad::compat::nvdiffrast {

template <class T>
struct InterpolateInput {
  VertexRows<T> attributes;  // [N,V,A], or [V,A] for all images
  FaceList faces;            // [F,3]
  PixelGrid grid;
  std::span<const T> rast, rast_db;          // [N,H,W,4] from rasterize; rast_db empty: no out_da
  std::span<const std::int32_t> diff_attrs;  // [D] channels in out_da, each in [0, A)
};

template <class T>
struct InterpolateOutput {
  std::span<T> out;     // [N,H,W,A]
  std::span<T> out_da;  // [N,H,W,2 D]
};

// Errors: an index out of range.
template <class T>
Status Interpolate(const InterpolateInput<T>& input, const Workers& workers,
                   const InterpolateOutput<T>& out);

template <class T>
struct InterpolateCotangents {
  std::span<const T> d_out, d_out_da;  // d_out_da may be empty
};

// Overwritten; empty ones are not computed.
template <class T>
struct InterpolateGradients {
  std::span<T> d_attributes;       // [N,V,A] or [V,A]
  std::span<T> d_rast, d_rast_db;  // [N,H,W,4]; d_rast only in channels u and v
};

template <class T>
Status InterpolateBackward(const InterpolateInput<T>& input,
                           const InterpolateCotangents<T>& cotangents, const Workers& workers,
                           const InterpolateGradients<T>& out);

// The input of a kernel. sloped: rows that begin with the attributes of diff_attrs, in their order.
struct InterpolateTask {
  const InterpolateInput<float>& input;
  const VertexRows<float>& sloped;
  Band band;
};
// Sums of the backward pass per face: for corners 0, 1, 2 the weight times d_out, then for u and v
// the derivatives times d_out_da, rows of A and of 2 D numbers rounded up to quads.
inline std::size_t InterpolateSums(const InterpolateInput<float>& input) {
  return 3 * ((input.attributes.channels + 3) / 4 * 4) +
         2 * ((2 * input.diff_attrs.size() + 3) / 4 * 4);
}

}  // namespace tilegrad::compat::nvdiffrast
