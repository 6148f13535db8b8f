// SPDX-License-Identifier: Apache-2.0
// A batch of images whose faces come already projected (compat/projected_faces.h), and
// what their checks have in common. For callers who project for themselves, as DIB-R's other
// implementations have it; whoever has vertices and cameras uses Renderer, which clips, covers
// exactly and interpolates with perspective.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "compat/projected_faces.h"
#include "scene/camera.h"
#include "tilegrad/status.h"

namespace tilegrad::compat {

// N images of F faces each, views over the caller's arrays.
template <class T>
struct ProjectedBatchT {
  std::size_t images = 0, faces = 0;
  std::span<const T> xy;                // [N,F,3,2] corners, NDC: x right, y up
  std::span<const T> z;                 // [N,F,3] camera z, the larger is nearer
  std::span<const std::uint8_t> valid;  // [N,F] 0 covers nothing; empty: all are valid

  ProjectedFacesT<T> image(std::size_t n) const {
    return {xy.subspan(6 * n * faces, 6 * faces),
            z.empty() ? z : z.subspan(3 * n * faces, 3 * faces),
            valid.empty() ? valid : valid.subspan(n * faces, faces)};
  }
};

inline std::size_t PixelCount(const ImageSize& size) {
  return static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height);
}

// Sizes of the batch, that xy is finite, the image's size, and that face_ids [N,H,W] (where it is
// not empty) are in [-1, F).
template <class T>
Status ValidateProjected(const ProjectedBatchT<T>& batch, const ImageSize& size,
                         std::span<const std::int32_t> face_ids);

}  // namespace tilegrad::compat
