// SPDX-License-Identifier: Apache-2.0
// The K nearest faces of every pixel, within a blur radius, as in PyTorch3D's rasterizer
// (compat/pytorch3d_fragment.h), and the adjoint. For porting code: Renderer needs no such lists.
// The same bits for any number of workers.
//
// A pixel lists a face if its area exceeds 1e-8, all its depths are >= 1e-8, and the pixel is
// inside, or nearer to its boundary than the root of blur_radius. Lists are sorted by depth,
// nearest first, then by index.
#pragma once

#include <cstdint>
#include <span>

#include "base/parallel.h"
#include "compat/pytorch3d_fragment.h"
#include "scene/camera.h"
#include "tilegrad/status.h"

namespace tilegrad::compat::pytorch3d {

struct LayeredOptions {
  ImageSize size;           // pixels, 1..16384; the shorter side spans [-1, 1]
  int faces_per_pixel = 1;  // K, 1..1024
  double blur_radius = 0;   // NDC^2, >= 0
  bool cull_backfaces = false;
  FragmentRule rule;
};

// Packed faces [first, first + count) make up one image.
struct FaceRange {
  std::int64_t first, count;
};

// [N,H,W,K], and [N,H,W,K,3] for barycentrics; all -1 after the last face of a pixel. Row 0 is on
// top, and x decreases along a row.
template <class T>
struct LayeredImages {
  std::span<std::int64_t> pix_to_face;  // index of the packed face
  std::span<T> zbuf, barycentrics, dists;
};

// face_vertices [F,3,3]: x, y, depth; of all images, packed. Errors name the array, the index and
// the expected value.
template <class T>
Status RasterizeLayers(std::span<const T> face_vertices, std::span<const FaceRange> images,
                       const LayeredOptions& options, const Workers& workers,
                       const LayeredImages<T>& out);

// dL/d(images), in the same shapes; empty spans mean zero. Overwrites d_face_vertices [F,3,3]. The
// lists of faces are held fixed.
template <class T>
struct LayeredAdjoint {
  std::span<const std::int64_t> pix_to_face;
  std::span<const T> d_zbuf, d_barycentrics, d_dists;
  std::span<T> d_face_vertices;
};
template <class T>
Status RasterizeLayersBackward(std::span<const T> face_vertices, const LayeredOptions& options,
                               const Workers& workers, const LayeredAdjoint<T>& adjoint);

}  // namespace tilegrad::compat::pytorch3d
