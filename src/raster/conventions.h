// SPDX-License-Identifier: Apache-2.0
// The rules of the rasterizer, defined once. docs/conventions.md explains them in prose.
//
// 1. Screen. x right, y down, pixels; pixel (column j, row i) is the square [j, j+1) x [i, i+1) and
//    its centre is (j + 0.5, i + 0.5). Camera and projection: scene/camera.h.
//
//        0        1        2  x
//      0 +--------+--------+--        NDC (what delta and the soft mask are measured in) spans
//        |        |        |          [-1, 1] over the image in each axis with y up:
//        |   *    |   *    |            x_ndc = 2 x / W - 1,   y_ndc = 1 - 2 y / H.
//        | (0,0)  | (1,0)  |
//      1 +--------+--------+--
//      y
//
// 2. Winding. Counter-clockwise faces, seen, are front faces. y points down, so their doubled area
//    (x1-x0)(y2-y0) - (x2-x0)(y1-y0) is negative. With culling off both windings are drawn; a
//    culled face covers no pixel but takes part in the soft mask, as in DIB-R.
//
//           2                  front: 0 -> 1 -> 2 against the clock
//          / \                 back:  with the clock
//         /   \                                                                              .
//        0-----1
//
// 3. Coverage is decided in integers. Vertices are rounded to the nearest 1/1024 pixel and the edge
//    functions of the rounded triangle are evaluated without error, so two faces that share an edge
//    (the same two vertices) cannot disagree about a pixel centre. A centre exactly on an edge
//    belongs to the face whose left or top edge it is:
//
//        +--------+       E(p) = (b - a) x (p - a), a -> b an edge of the face, wound so that its
//        |\       |       doubled area is positive (clockwise as seen); inside is E > 0, and E = 0
//        | \  B   |       only on
//        |  \     |         left edges (they go up: b.y < a.y) and
//        | A *    |         top edges (horizontal, going right: b.y = a.y, b.x > a.x).
//        |    \   |       The centre * lies on the diagonal: the diagonal is B's left edge and A's
//        +-----\--+       right edge, so B has the pixel and A has not.
//
//    Hence a centre inside a closed fan of faces is covered exactly once, and there are neither
//    cracks nor doubled pixels. Everything smooth (interpolation, the soft mask, gradients) uses
//    the unrounded coordinates: it stays differentiable, and its weights may leave [0, 1] by what
//    1/2048 pixel makes.
//
// 4. Depth. The nearest face wins; depth = -p_cam.z at the pixel centre, compared as 1/depth, which
//    is linear on the screen. At equal 1/depth (coinciding faces) the face with the lower id in the
//    caller's mesh wins.
//
// 5. Face ids are indices into the caller's faces, int32; -1 is background. A pixel is foreground
//    (alpha = 1) if and only if it has a face id. An array of a scene has less than 2^28 numbers,
//    so a mesh has at most 89,478,485 faces; larger ones are an error of Render.
//
// 6. Near plane. Faces are cut at depth = near_plane and the part beyond is kept; the new vertices
//    are computed from the two ends of the cut edge in the order visible end, hidden end, so that
//    faces that share the edge get the same vertex. A quadrilateral is divided from that of its two
//    old corners whose position is less (x, then y, then z, as given), so that coinciding faces get
//    the same pieces. Pieces keep the id of their source face, and gradients flow through the cut.
//
//            visible   |near|   hidden          v = (1 - t) a + t b,
//              a-------v- - - - -b              t = (near - depth_a) / (depth_b - depth_a)
//
// 7. Not drawn: faces wholly nearer than the near plane; faces of zero area after rounding
//    (degenerate; in the soft mask they are segments or points); culled faces; faces with a vertex
//    whose projection overflows (they take no part in the soft mask either). Off-screen faces cover
//    nothing, but may reach into the image softly. Non-finite input is an error of Render.
//
// 8. Slivers. Interpolation divides by a face's height on the screen. A face thinner than 1/64
//    pixel is interpolated flat: the mean of its corners, and no gradient of positions through
//    attributes, since that gradient grows with 1/height without bound. So is a face with an edge
//    of 2^39 pixels or more: clamping its corners turns the edges of its coverage, so that pixels
//    inside have weights far outside of [0, 1], whose ratio (equation 1) is any number.
//
// 9. Parts of an image, from large to small. The same words everywhere in src/:
//
//      band    whole rows, BandGrid: the unit of work of gradients of attributes
//      bin     64 x 64 pixels: faces are listed and drawn by bins; the unit of work forward
//      tile    16 x 16 pixels of a bin: the unit of coverage in 32 bits and of the soft mask
//      block   8 x 8 pixels of a tile: what the soft mask sorts faces for
//      strip   up to a bin's width of pixels, interpolated together, then shaded
//      run     up to 256 pixels of a strip that show one surface: what a shading kernel sees
//
//      bin +----+----+----+----+      Faces have words of their own: a chunk is a range of faces
//          |tile|    |    |    |      that one task prepares, a packet 16 faces that lie side by
//          +----+----+----+----+      side in memory for vectors, a node a packet in the hierarchy
//          |    |    | blk|blk |      of the soft mask.
//          +----+----+----+----+
//          |    |    | blk|blk |
//          +----+----+----+----+
#pragma once

#include <cstdint>

namespace tilegrad::raster {

inline constexpr int kSubpixelBits = 10;  // coverage: 1/1024 pixel
inline constexpr std::int64_t kSubpixels = std::int64_t{1} << kSubpixelBits;
inline constexpr double kSnapError = 0.5 / kSubpixels;  // pixels, on each axis
inline constexpr int kTileBits = 4;
inline constexpr int kTileSize = 1 << kTileBits;  // pixels
inline constexpr int kBinBits = 6;
inline constexpr int kBinSize = 1 << kBinBits;  // pixels; faces are drawn by bins, of 4 x 4 tiles
inline constexpr int kMaxImageSize = 16384;     // pixels, each axis
// Within this range the edge functions can step through a tile in 32 bits (see coverage.h); every
// vertex on the largest image is inside.
inline constexpr float kGuardBand = 16384.0f;  // pixels
// Coordinates beyond are clamped, for coverage only: the exact edge functions need 128 bits.
inline constexpr double kMaxSnap = 0x1p40;       // pixels
inline constexpr double kFlatHeight = 1.0 / 64;  // pixels, rule 8
// Pixels, rule 8: a face that is clamped and reaches the image has a longer edge.
inline constexpr double kFlatLength = kMaxSnap / 2;

inline constexpr std::int32_t kNoFace = -1;  // a background pixel

}  // namespace tilegrad::raster
