// SPDX-License-Identifier: Apache-2.0
// What the pipeline takes and gives: scenes with what is interpolated over their faces, which the
// renderer has laid side by side (render/shading/inputs.h), and images (render/frame_images.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "raster/attributes.h"
#include "raster/interpolate.h"
#include "raster/near_clip.h"
#include "raster/screen_mesh.h"
#include "raster/seen_faces.h"
#include "scene/camera.h"
#include "tilegrad/options.h"
#include "tilegrad/scene.h"

namespace tilegrad {

// A scene of a batch as it is drawn: checked, and kept alive and unchanged until the call ends.
struct PipelineScene {
  const Scene* mesh;  // positions, faces and camera
  // In the layout of the scene: what is interpolated, and on the way back gets a gradient;
  raster::AttributeViewT<const float> attributes;
  // and what a PixelStage needs again on the way back.
  raster::AttributeViewT<const float> recomputed = {};
};

// dL/d(what is interpolated), an image of as many channels as it has, and dL/d(alpha); empty: zero.
struct PipelineCotangents {
  std::span<const float> attributes;
  std::span<const float> alpha;
};

// dL/d(scene), overwritten. An empty span (or false) is not computed.
struct PipelineGradients {
  std::span<float> positions;   // [V,3]
  std::span<float> attributes;  // as in the scene
  bool camera = false;          // fill d_camera
  Camera d_camera;              // as SceneGradientsT::camera
};

template <class T>
raster::FaceSource<T> FaceSourceOf(const SceneT<T>& scene, const RenderOptions& options) {
  return {scene.positions, scene.faces, &scene.camera, options.culling == FaceCulling::kBack};
}

// What a call of the pipeline did, and how long it took.

// What a call of Render or Backward did. Parts: bins of an image where it is drawn or given alpha,
// bands of it on the way back through attributes.
struct RenderStats {
  std::int64_t prepared = 0;  // images projected and listed; others were as they had been before
  std::int64_t drawn = 0;     // parts
  std::int64_t interpolated = 0;  // parts, forward or backward
  std::int64_t alpha_parts = 0;   // parts, forward or backward
  std::int64_t merged = 0;        // arrays of gradients: positions and attributes count apart
  // Of the soft mask, forward or backward, lanes of vectors that had no face included. They depend
  // on the instruction set.
  std::int64_t pairs = 0;       // of a face and a background pixel that were evaluated
  std::int64_t powers = 0;      // exponentials
  const char* alpha_rule = "";  // AlphaStage::name, where alpha was made or pulled on
};

// Milliseconds in the stages of a call, summed over workers.
struct RenderTimes {
  double prepare = 0;      // project, bin, and the hierarchy of the soft mask
  double visibility = 0;   // which face a pixel shows, and depth
  double interpolate = 0;  // attributes of pixels, forward or backward
  double stage = 0;        // a PixelStage
  double gradients = 0;    // from attributes of pixels to faces
  double alpha = 0;        // the soft mask, forward or backward
  double merge = 0;        // from faces to the scene
};

// What may stand between interpolated attributes and images, bin by bin while they are in the
// cache, and on the way back. The renderer then keeps no image of attributes: they are interpolated
// again where the way back needs them.

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
