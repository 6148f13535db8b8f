// SPDX-License-Identifier: Apache-2.0
// Per-face data for drawing, set up once per image: shape, box, edge functions, depth.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/aligned.h"
#include "base/parallel.h"
#include "raster/corner_packets.h"
#include "raster/coverage.h"
#include "raster/face_plane.h"
#include "raster/screen_mesh.h"

namespace tilegrad::raster {

// Faces whose box is at most this many pixels wide and high get their coverage at set-up, as a bit
// square of this size (a stamp).
inline constexpr int kStamp = 4;

// A face with a pixel centre of the image in its box; if it fits a stamp, it covers one. Edge k at
// pixel (column, row) is
// edge[k] + step_x[k] * (column - column_begin) + step_y[k] * (row - row_begin), and the pixel is
// covered if none is negative: the exact edge functions, divided by kSubpixels and rounded down,
// which keeps their sign because a step of one pixel is a multiple of kSubpixels.
struct DrawnFace {
  static constexpr std::int32_t kByTiles = 0;   // not SnappedFace::small; pixels and edges are not
                                                // set (TileFaceSetup computes them per tile)
  static constexpr std::int32_t kByEdges = -1;  // small, the box exceeds a stamp: edges are set

  std::int32_t face;  // index into the ScreenMesh
  // kByTiles, kByEdges, or the stamp: bit kStamp * row + column is set if the face covers that
  // pixel, relative to (column_begin, row_begin). With a stamp, edges may be unset.
  std::int32_t pixels;
  std::int16_t column_begin, column_end, row_begin, row_end;  // pixels, within the image
  DepthPlane<float> depth;
  std::int32_t edge[3], step_x[3], step_y[3];
};
static_assert(sizeof(DrawnFace) == 80);

// The bins of a face (BinGrid): `columns` x `rows` from bin `first` on.
struct BinRange {
  std::int32_t first;
  std::int16_t columns, rows;
};

// Faces are set up in chunks, shared among workers; each chunk writes its own list, which starts in
// `storage` at the mesh index of its first face. Reused from frame to frame: grows to the largest
// mesh seen.
struct DrawnFaces {
  static constexpr std::size_t kChunk = 8192;  // faces
  AlignedVector<DrawnFace> storage;            // unspecified between the lists
  AlignedVector<BinRange> bins;                // of each
  AlignedVector<std::size_t> counts;           // [chunks] lengths of the lists

  std::span<const DrawnFace> list(std::size_t chunk) const {  // ascending by face
    return std::span(storage).subspan(chunk * kChunk, counts[chunk]);
  }
  std::span<const BinRange> bins_of_list(std::size_t chunk) const {
    return std::span(bins).subspan(chunk * kChunk, counts[chunk]);
  }
};

// Faces [begin, end) of a mesh.
struct SomeFaces {
  std::size_t begin, end;
  bool cull_back;
};

// What to set up for the faces of an image; null: nothing.
struct FaceSetUp {
  DrawnFaces* drawn = nullptr;       // drawn faces that may cover a pixel of the image
  CornerPackets* corners = nullptr;  // faces that take part in the soft mask
};

// Where records are written.
struct FaceList {
  DrawnFace* face;
  BinRange* bins;
};

// Sets the bits of `reject` [F] determined by the shape on the screen (degenerate, culled);
// bits that are set on entry stay, and such faces are not drawn. `workers` null: the calling
// thread.
void SetUpFaces(const ScreenMesh& mesh, bool cull_back, std::span<std::uint8_t> reject,
                const FaceSetUp& out, const Workers* workers = nullptr);

}  // namespace tilegrad::raster
