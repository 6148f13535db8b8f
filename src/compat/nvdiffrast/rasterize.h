// SPDX-License-Identifier: Apache-2.0
// The first of nvdiffrast's operations: the visible face at each pixel, and the barycentrics there.
//
// The operations (rasterize, interpolate, texture, antialias) are those of Laine et al., Modular
// Primitives for High-Performance Differentiable Rendering, 2020: each reads and writes whole
// images, so that callers compose and differentiate them as they like. Vertices are in OpenGL clip
// space; images have their bottom row first (clip_mesh.h). T is float or double; arithmetic is in
// double.
//
//     rast     (u, v, z/w, face + 1)   u, v: perspective-correct weights of corners 0, 1, clamped
//                                      to [0, 1] with u + v <= 1; four zeros for background pixels
//     rast_db  (du/dX, du/dY, dv/dX, dv/dY)   per pixel
//
// The nearest face by z/w between the near and the far plane is visible; of coinciding ones the
// first. There is no culling. Visibility and z/w have no gradient; u, v and rast_db have one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "base/parallel.h"
#include "compat/nvdiffrast/clip_mesh.h"
#include "tilegrad/status.h"

namespace tilegrad::compat::nvdiffrast {

template <class T>
struct RasterizeInput {
  VertexRows<T> positions;               // [N,V,4], or [V,4]
  FaceList faces;                        // [F,3]
  std::span<const std::int32_t> ranges;  // [N,2] first face and count; empty: all, in every image
  PixelGrid grid;
};

template <class T>
struct RasterizeOutput {
  std::span<T> rast, rast_db;  // [N,H,W,4]; rast_db may be empty
  // [N,H,W], or empty. Depth peeling; larger is nearer: only faces behind this depth are visible,
  // and it is updated to theirs. Infinity before the first layer.
  std::span<float> peeled;
};

// Limit at which float still represents face ids exactly, as rast requires.
inline constexpr std::size_t kMostFaces = std::size_t{1} << 24;

// Reuses memory from call to call. Not thread-safe.
class Rasterizer {
 public:
  Rasterizer();
  ~Rasterizer();

  // Errors: sizes that do not match, an index or range outside of its array, a position that is not
  // finite.
  template <class T>
  Status Run(const RasterizeInput<T>& input, const Workers& workers, const RasterizeOutput<T>& out);

 private:
  struct Scratch;
  std::unique_ptr<Scratch> scratch_;
};

// Cotangents of an image from Run.
template <class T>
struct RasterizeCotangents {
  std::span<const T> rast;               // [N,H,W,4] as returned by Run
  std::span<const T> d_rast, d_rast_db;  // [N,H,W,4]; either may be empty
};

// d_positions [N,V,4] or [V,4] is overwritten. Errors as above.
template <class T>
Status RasterizeBackward(const RasterizeInput<T>& input, const RasterizeCotangents<T>& cotangents,
                         const Workers& workers, std::span<T> d_positions);

}  // namespace tilegrad::compat::nvdiffrast
