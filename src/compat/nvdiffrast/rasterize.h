// SPDX-License-Identifier: Apache-2.0
// The first of nvdiffrast's operations: which face is seen in each pixel, and where on it.
//
// The operations (rasterize, interpolate, texture, antialias) are those of Laine et al., Modular
// Primitives for High-Performance Differentiable Rendering, 2020: each reads and writes whole
// images, so that callers compose and differentiate them as they like. Vertices are in the clip
// space of OpenGL; images have their bottom row first (clip_mesh.h). T is float or double;
// arithmetic is done in double.
//
//     rast     (u, v, z/w, face + 1)   u, v: perspective-correct weights of corners 0 and 1, kept
//                                      in [0, 1] with u + v <= 1; four zeros where nothing is seen
//     rast_db  (du/dX, du/dY, dv/dX, dv/dY)   per pixel
//
// The nearest face by z/w between the near and the far plane is seen; of coinciding ones the first.
// Faces are seen from both sides. What is seen has no gradient; u, v and rast_db have one, z/w not.
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
  // [N,H,W], or empty. A measure of depth, larger is nearer: only what lies behind it is seen, and
  // it moves to what was seen. Infinity before the first layer.
  std::span<float> peeled;
};

// Faces that a float names exactly: rast holds their number.
inline constexpr std::size_t kMostFaces = std::size_t{1} << 24;

// Memory that is reused from call to call. Not thread-safe.
class Rasterizer {
 public:
  Rasterizer();
  ~Rasterizer();

  // Errors: sizes that do not fit together, an index or range outside of its array, a position that
  // is not finite.
  template <class T>
  Status Run(const RasterizeInput<T>& input, const Workers& workers, const RasterizeOutput<T>& out);

 private:
  struct Scratch;
  std::unique_ptr<Scratch> scratch_;
};

// Cotangents of an image that Run has made.
template <class T>
struct RasterizeCotangents {
  std::span<const T> rast;               // [N,H,W,4] what Run returned
  std::span<const T> d_rast, d_rast_db;  // [N,H,W,4]; either may be empty
};

// d_positions [N,V,4] or [V,4] is overwritten. Errors as above.
template <class T>
Status RasterizeBackward(const RasterizeInput<T>& input, const RasterizeCotangents<T>& cotangents,
                         const Workers& workers, std::span<T> d_positions);

}  // namespace tilegrad::compat::nvdiffrast
