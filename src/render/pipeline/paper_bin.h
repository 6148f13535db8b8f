// SPDX-License-Identifier: Apache-2.0
// The rule of raster/soft_mask/paper_ref.h, tile by tile: visits only faces near a tile, in order,
// with the same result as visiting all. Scalar; T: float, double. Used by the renderer
// (alpha_stage.cc) and for projected faces (compat/kaolin/projected_raster.h).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "raster/bin.h"
#include "raster/screen_mesh.h"
#include "raster/soft_mask/paper_ref.h"
#include "tilegrad/options.h"

namespace tilegrad {

// 1 / delta, limited to what float can multiply by: the kernel is sharper than pixels long before,
// and infinity times the distance 0 would be NaN.
inline double InverseDelta(double delta) { return std::min(1 / delta, 1e30); }

inline raster::PaperSoftMask PaperRuleOf(const RenderOptions& options) {
  return {.inverse_delta = InverseDelta(options.delta),
          .box = options.paper_box,
          .max_faces = options.paper_faces};
}

// Pixels to NDC.
template <class T>
T NdcX(const T& x, int width) {
  return T(2) * x / T(width) - T(1);
}
template <class T>
T NdcY(const T& y, int height) {
  return T(1) - T(2) * y / T(height);
}

template <class T>
raster::NdcFace<T> NdcFaceOf(const raster::ScreenMeshT<T>& mesh, std::size_t face) {
  raster::NdcFace<T> out;
  for (int k = 0; k < 3; ++k) {
    const auto v = static_cast<std::size_t>(mesh.vertex(face, k));
    out.x[k] = NdcX(mesh.x[v], mesh.width);
    out.y[k] = NdcY(mesh.y[v], mesh.height);
  }
  return out;
}

// Some faces of an image, in order, with their indices.
template <class T>
struct NearFacesT {
  std::vector<raster::NdcFace<T>> faces;
  std::vector<std::size_t> source;
};

// The faces whose box, grown by `box` (NDC), may contain a pixel centre of `rect`, in an image of
// width x height.
template <class T>
NearFacesT<T> FacesNear(std::span<const raster::NdcFace<T>> faces, const raster::PixelRect& rect,
                        int width, int height, double box) {
  const double grown = box + 1e-5;  // margin for rounding to float in InPaperBox
  const double x0 = NdcX(double(rect.x0), width) - grown;
  const double x1 = NdcX(double(rect.x1), width) + grown;
  const double y0 = NdcY(double(rect.y1), height) - grown;
  const double y1 = NdcY(double(rect.y0), height) + grown;
  NearFacesT<T> out;
  for (std::size_t n = 0; n < faces.size(); ++n) {
    const raster::NdcFace<T>& f = faces[n];
    const auto [left, right] = std::minmax({f.x[0], f.x[1], f.x[2]});
    const auto [bottom, top] = std::minmax({f.y[0], f.y[1], f.y[2]});
    if (right < x0 || left > x1 || top < y0 || bottom > y1) continue;
    out.faces.push_back(f);
    out.source.push_back(n);
  }
  return out;
}

// The same from faces near a larger rectangle.
template <class T>
NearFacesT<T> FacesNear(const NearFacesT<T>& of, const raster::PixelRect& rect, int width,
                        int height, double box) {
  NearFacesT<T> out = FacesNear<T>(of.faces, rect, width, height, box);
  for (std::size_t& source : out.source) source = of.source[source];
  return out;
}

// Whole tiles of one image. `face_ids` [H,W] are the image's; < 0 is background.
struct PaperRegion {
  raster::PixelRect rect;
  int width, height;
  const std::int32_t* face_ids;
};

// Calls visit(tile, faces near it) for the tiles of a region, row by row.
template <class T, class Visit>
void ForPaperTiles(std::span<const raster::NdcFace<T>> faces, double box, const PaperRegion& region,
                   const Visit& visit) {
  const int width = region.width, height = region.height;
  const NearFacesT<T> near = FacesNear<T>(faces, region.rect, width, height, box);
  raster::ForTiles(region.rect, [&](const raster::PixelRect& rect) {
    visit(PaperRegion{rect, width, height, region.face_ids},
          FacesNear(near, rect, width, height, box));
  });
}

// Calls visit(pixel index in the image, x, y), in NDC, for the pixels of a tile.
template <class T, class Visit>
void ForNdcPixels(const PaperRegion& tile, const Visit& visit) {
  for (int i = tile.rect.y0; i < tile.rect.y1; ++i) {
    for (int j = tile.rect.x0; j < tile.rect.x1; ++j) {
      visit(static_cast<std::size_t>(i) * static_cast<std::size_t>(tile.width) +
                static_cast<std::size_t>(j),
            NdcX(static_cast<T>(j) + T(0.5), tile.width),
            NdcY(static_cast<T>(i) + T(0.5), tile.height));
    }
  }
}

// Writes alpha [H,W] of the region's pixels: 1 in the foreground, the rule elsewhere.
template <class T>
void PaperForward(std::span<const raster::NdcFace<T>> faces, const raster::PaperSoftMask& rule,
                  const PaperRegion& region, T* alpha) {
  ForPaperTiles(faces, rule.box, region, [&](const PaperRegion& tile, const NearFacesT<T>& near) {
    ForNdcPixels<T>(tile, [&](std::size_t pixel, const T& x, const T& y) {
      alpha[pixel] =
          tile.face_ids[pixel] >= 0 ? T(1) : raster::PaperAlphaRef<T>(near.faces, x, y, rule);
    });
  });
}

// dL/d(corners) of the faces near each of the region's tiles, in NDC; d_alpha [H,W].
template <class T>
std::vector<NearFacesT<T>> PaperBackward(std::span<const raster::NdcFace<T>> faces,
                                         const raster::PaperSoftMask& rule,
                                         const PaperRegion& region, const T* d_alpha) {
  std::vector<NearFacesT<T>> out;
  ForPaperTiles(faces, rule.box, region, [&](const PaperRegion& tile, NearFacesT<T> near) {
    std::vector<raster::NdcFace<T>> d_faces(near.faces.size());
    ForNdcPixels<T>(tile, [&](std::size_t pixel, const T& x, const T& y) {
      if (tile.face_ids[pixel] >= 0 || d_alpha[pixel] == 0) return;
      raster::PaperAlphaRefBackward<T>(near.faces, x, y, rule, d_alpha[pixel], d_faces);
    });
    out.push_back({std::move(d_faces), std::move(near.source)});
  });
  return out;
}

}  // namespace tilegrad
