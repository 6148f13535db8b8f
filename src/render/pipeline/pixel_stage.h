// SPDX-License-Identifier: Apache-2.0
// What may stand between interpolated attributes and images, bin by bin while they are in the
// cache, and on the way back. The renderer then keeps no image of attributes: they are interpolated
// again where the way back needs them.
#pragma once

#include <cstddef>

#include "raster/attributes.h"
#include "raster/interpolate.h"
#include "raster/screen_mesh.h"
#include "raster/seen_faces.h"

namespace tilegrad {

// Pixels of one image of the batch, up to kBinSize wide.
struct PixelStrip {
  std::size_t image, band;  // band: on the way back
  std::size_t worker;       // selects scratch
  const raster::ScreenMesh* mesh;
  raster::AttributeViewT<const float> attributes;  // what was interpolated, in the mesh's layout
  raster::FaceRows rows;                           // kBinSize wide
  int columns;                                     // of each row that are in the image
  std::size_t first;                               // pixel of an image that is the strip's first
  const float* varyings;                           // [channels][rows * kBinSize]
  bool any_face;                                   // false: all background; nothing to read

  std::size_t plane() const { return rows.pixels(); }
};

class PixelStage {
 public:
  virtual ~PixelStage() = default;

  // Writes its images for the pixels of a strip.
  virtual void Forward(const PixelStrip& strip) = 0;

  // Before the strips of a band, which have PipelineScene::recomputed. False: a cotangent is not
  // finite.
  virtual bool BeginBand(std::size_t image, std::size_t band, std::size_t first,
                         std::size_t pixels) = 0;
  // Writes the cotangents of the attributes, from the strip's first pixel on; those of background
  // pixels are not read.
  virtual void Backward(const PixelStrip& strip, const raster::PlanarView<float>& d_varyings) = 0;
};

}  // namespace tilegrad
