// SPDX-License-Identifier: Apache-2.0
// Inputs and outputs of the pipeline: scenes with their attributes, which the renderer has packed
// (render/shading/inputs.h), and images (render/frame_images.h).
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

// A scene of a batch: validated, and alive and unchanged until the call ends.
struct PipelineScene {
  const Scene* mesh;  // positions, faces and camera
  // In the scene's layout: attributes to interpolate, which get a gradient in the backward pass;
  raster::AttributeViewT<const float> attributes;
  // and those that a PixelStage needs again in the backward pass.
  raster::AttributeViewT<const float> recomputed = {};
};

// dL/d(attributes), an image with as many channels, and dL/d(alpha); empty means zero.
struct PipelineCotangents {
  std::span<const float> attributes;
  std::span<const float> alpha;
};

// dL/d(scene), overwritten. Empty (or false): not computed.
struct PipelineGradients {
  std::span<float> positions;   // [V,3]
  std::span<float> attributes;  // as in the scene
  bool camera = false;          // fill d_camera
  Camera d_camera;              // as in SceneGradientsT::camera
};

template <class T>
raster::FaceSource<T> FaceSourceOf(const SceneT<T>& scene, const RenderOptions& options) {
  return {scene.positions, scene.faces, &scene.camera, options.culling == FaceCulling::kBack};
}

// Counts and times of a pipeline call.

// Counts of a Render or Backward. Parts are bins when drawing or for alpha, bands in the backward
// pass of attributes.
struct RenderStats {
  std::int64_t prepared = 0;      // images projected and binned; others were reused
  std::int64_t drawn = 0;         // parts
  std::int64_t interpolated = 0;  // parts, forward or backward
  std::int64_t alpha_parts = 0;   // parts, forward or backward
  std::int64_t merged = 0;        // gradient arrays; positions and attributes count separately
  // Of the soft mask, forward or backward, including vector lanes without a face. They depend on
  // the instruction set.
  std::int64_t pairs = 0;       // evaluated pairs of a face and a background pixel
  std::int64_t powers = 0;      // exponentials
  const char* alpha_rule = "";  // AlphaStage::name, if alpha or its gradient ran
};

// Milliseconds in the stages of a call, summed over workers.
struct RenderTimes {
  double prepare = 0;      // project, bin, build the tree of the soft mask
  double visibility = 0;   // the visible face per pixel, and depth
  double interpolate = 0;  // attributes of pixels, forward or backward
  double stage = 0;        // a PixelStage
  double gradients = 0;    // from pixel attributes to faces
  double alpha = 0;        // the soft mask, forward or backward
  double merge = 0;        // from faces to the scene
};

// An optional stage between interpolated attributes and images, forward and backward, bin by bin
// while they are in the cache. The renderer then keeps no attribute image: the backward pass
// interpolates them again.

// Pixels of one image of the batch, up to kBinSize wide.
struct PixelStrip {
  std::size_t image, band;  // band: in the backward pass
  std::size_t worker;       // selects scratch
  const raster::ScreenMesh* mesh;
  raster::AttributeViewT<const float> attributes;  // to interpolate, in the mesh's layout
  raster::FaceRows rows;                           // kBinSize wide
  int columns;                                     // of each row inside the image
  std::size_t first;                               // index of the strip's first pixel in the image
  const float* varyings;                           // [channels][rows * kBinSize]
  bool any_face;                                   // false: all background, nothing to read

  std::size_t plane() const { return rows.pixels(); }
};

class PixelStage {
 public:
  virtual ~PixelStage() = default;

  // Writes its images for the pixels of a strip.
  virtual void Forward(const PixelStrip& strip) = 0;

  // Called before the strips of a band, which have PipelineScene::recomputed. False: a cotangent is
  // not finite.
  virtual bool BeginBand(std::size_t image, std::size_t band, std::size_t first,
                         std::size_t pixels) = 0;
  // Writes the cotangents of the attributes, from the strip's first pixel on; background pixels are
  // not read.
  virtual void Backward(const PixelStrip& strip, const raster::PlanarView<float>& d_varyings) = 0;
};

}  // namespace tilegrad
