// SPDX-License-Identifier: Apache-2.0
// Numbers the faces visible in a part of an image, so that per-face work is done once and gradients
// are summed per face before they leave the part.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "base/aligned.h"
#include "raster/conventions.h"

namespace tilegrad::raster {

// Pixels [x0, x0 + width) of rows [row_begin, row_end) of an image.
struct FaceRows {
  const std::int32_t* faces;  // [rows][width] faces of the mesh, kNoFace at background pixels
  int width, x0;
  int row_begin, row_end;

  const std::int32_t* row(int i) const {
    return faces + static_cast<std::ptrdiff_t>(i - row_begin) * width;
  }
  std::size_t pixels() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(row_end - row_begin);
  }
};

// Slots number the faces in order of first appearance; slot 0 is for background pixels. Scratch of
// one worker, which grows to the largest part and mesh.
struct SeenFaces {
  AlignedVector<std::int32_t> slot_of_face;  // [1 + F], -1 where not seen; [0] is kNoFace, slot 0
  std::size_t count = 0;                     // slots in use, including slot 0
  AlignedVector<std::int32_t> face;          // [slot]
  // [slot] centre of the first pixel that shows the face: positions relative to it keep the digits
  // of tiny faces.
  AlignedVector<float> origin_x, origin_y;

  std::size_t faces() const { return count - 1; }
  // Number of slots in arrays of whole vectors: slots beyond `count`, and slot 0, are copies of
  // slot 1.
  std::size_t stride() const { return (count + kTileSize - 1) / kTileSize * kTileSize; }
  // The most slots that `pixels` of a mesh can need.
  static std::size_t MostSlots(std::size_t mesh_faces, std::size_t pixels) {
    return std::min(mesh_faces, pixels) + 2 + kTileSize;
  }
};

// Grows the arrays to the most that the part can need: which worker gets which part varies between
// calls, and once every size has occurred nothing may allocate.
void ReserveSeenFaces(std::size_t mesh_faces, std::size_t pixels, SeenFaces* out);

// Reserves, then numbers. `out` must be empty: new, or after ForgetFaces.
void NumberFaces(const FaceRows& rows, std::size_t mesh_faces, SeenFaces* out);
void ForgetFaces(SeenFaces* faces);

}  // namespace tilegrad::raster
