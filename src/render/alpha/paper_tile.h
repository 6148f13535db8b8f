// SPDX-License-Identifier: Apache-2.0
// A tile of an image under the rule of raster/soft_mask/paper_ref.h: only faces near it
// are looked at, in their order, so the result is that of all of them. Scalar; T: float, double.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "raster/bin.h"
#include "raster/soft_mask/paper_ref.h"

namespace tilegrad {

// Pixels to NDC.
template <class T>
T NdcX(const T& x, int width) {
  return T(2) * x / T(width) - T(1);
}
template <class T>
T NdcY(const T& y, int height) {
  return T(1) - T(2) * y / T(height);
}

// Some faces of an image, in their order, and where they come from.
template <class T>
struct NearFacesT {
  std::vector<raster::NdcFace<T>> faces;
  std::vector<std::size_t> source;
};

// Those whose box, grown by `box` (NDC), may hold a pixel centre of `rect`, in an image of width x
// height.
template <class T>
NearFacesT<T> FacesNear(std::span<const raster::NdcFace<T>> faces, const raster::PixelRect& rect,
                        int width, int height, double box) {
  const double grown = box + 1e-5;  // of rounding to float in InPaperBox
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
    out.faces.push_back(f), out.source.push_back(n);
  }
  return out;
}

// The same of faces that were near a larger rectangle.
template <class T>
NearFacesT<T> FacesNear(const NearFacesT<T>& of, const raster::PixelRect& rect, int width,
                        int height, double box) {
  NearFacesT<T> out = FacesNear<T>(of.faces, rect, width, height, box);
  for (std::size_t& source : out.source) source = of.source[source];
  return out;
}

// One tile of one image. `face_ids` [H,W] are the image's; < 0 is background.
struct PaperTile {
  raster::PixelRect rect;
  int width, height;
  const std::int32_t* face_ids;
};

// Calls visit(pixel of the image, x, y) in NDC for the background pixels of a tile.
template <class T, class Visit>
void ForBackground(const PaperTile& tile, const Visit& visit) {
  for (int i = tile.rect.y0; i < tile.rect.y1; ++i) {
    for (int j = tile.rect.x0; j < tile.rect.x1; ++j) {
      const auto pixel = static_cast<std::size_t>(i) * static_cast<std::size_t>(tile.width) +
                         static_cast<std::size_t>(j);
      if (tile.face_ids[pixel] >= 0) continue;
      visit(pixel, NdcX(static_cast<T>(j) + T(0.5), tile.width),
            NdcY(static_cast<T>(i) + T(0.5), tile.height));
    }
  }
}

// Writes alpha [H,W] of the tile's background pixels.
template <class T>
void PaperTileAlpha(const NearFacesT<T>& near, const raster::PaperSoftMask& rule,
                    const PaperTile& tile, T* alpha) {
  ForBackground<T>(tile, [&](std::size_t pixel, const T& x, const T& y) {
    alpha[pixel] = raster::PaperAlphaRef<T>(near.faces, x, y, rule);
  });
}

// dL/d(corners) of the faces near a tile, in NDC; d_alpha [H,W].
template <class T>
NearFacesT<T> PaperTileBackward(NearFacesT<T> near, const raster::PaperSoftMask& rule,
                                const PaperTile& tile, const T* d_alpha) {
  std::vector<raster::NdcFace<T>> d_faces(near.faces.size());
  ForBackground<T>(tile, [&](std::size_t pixel, const T& x, const T& y) {
    if (d_alpha[pixel] == 0) return;
    raster::PaperAlphaRefBackward<T>(near.faces, x, y, rule, d_alpha[pixel], d_faces);
  });
  return {std::move(d_faces), std::move(near.source)};
}

}  // namespace tilegrad
