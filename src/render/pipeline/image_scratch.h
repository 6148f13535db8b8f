// SPDX-License-Identifier: Apache-2.0
// Scratch of a Renderer, per image of the batch and per worker. All of it grows to its largest use
// and stays allocated.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "base/aligned.h"
#include "base/parallel.h"
#include "raster/attributes.h"
#include "raster/bin.h"
#include "raster/drawn_faces.h"
#include "raster/interpolate.h"
#include "raster/interpolate_backward.h"
#include "raster/project.h"
#include "raster/screen_mesh.h"
#include "raster/soft_mask/setup.h"
#include "raster/soft_mask/tree.h"
#include "raster/visibility.h"
#include "render/pipeline/records.h"

namespace tilegrad {

// The faces of a batch's meshes. Scenes that share their array of faces, as those of a template
// mesh do, share everything derived from it, which then stays in the cache from image to image.

// Identifies the faces that an image was prepared from.
struct TopologyId {
  std::size_t index = 0;
  std::uint64_t version = 0;  // 0: no faces
  bool operator==(const TopologyId&) const = default;
};

struct FaceTopology {
  TopologyId id;
  std::size_t vertices = 0;
  AlignedVector<std::int32_t> faces;  // [F,3] as given, all in [0, vertices)
  raster::FaceCorners corners;        // of `faces`
};

// Grows to its largest use and stays allocated.
class Topologies {
 public:
  // Builds the topologies of a batch, unless they are those of the last one.
  void Update(std::span<const PipelineScene> scenes, const Workers& workers);

  // The topology of scene n. Images may keep views of its corners as long as it has the same id.
  const FaceTopology& of(std::size_t n) const { return topologies_[of_scene_[n]]; }

 private:
  void Group(std::span<const PipelineScene> scenes);

  std::deque<FaceTopology> topologies_;   // a deque, so that addresses stay valid as it grows
  std::vector<std::size_t> of_scene_;     // index into topologies_, per scene
  std::vector<std::size_t> first_scene_;  // that uses it, per topology
  std::uint64_t updates_ = 0;
};

// The inputs an ImageScratch was made from, to see whether it is still valid: a backward pass
// mostly follows the forward pass of the same scenes.
struct PreparedFrom {
  bool valid = false, drawn_bins = false, alpha = false;
  AlignedVector<float> positions;
  TopologyId topology;
  CameraT<float> camera;
  RenderOptions options;
};

// A scene projected to the screen, ready for its bins.
struct ImageScratch {
  raster::ScreenMeshBuffers buffers;
  raster::ScreenMesh mesh;
  AlignedVector<float> clipped_attributes;
  raster::AttributeViewT<const float> attributes;  // in the layout of `mesh`
  AlignedVector<float> clipped_recomputed;
  raster::AttributeViewT<const float> recomputed;  // for a PixelStage, in the layout of `mesh`
  raster::DrawnFaces drawn_faces;
  raster::BinListBuffers drawn_buffers;
  raster::BinLists drawn;
  raster::SoftTree soft;                                 // if the alpha rule needs it
  AlignedVector<float> d_band_vertices, d_bin_vertices;  // of a large image, like MergeScratch's
  PreparedFrom prepared;
};

// Gradients of one image in the layout of its screen mesh.
struct MergeScratch {
  AlignedVector<float> d_vertices;              // [V][4] d_x, d_y, d_inverse_depth, 0
  AlignedVector<float> d_rows;                  // [rows of attributes][groups of channels][4]
  AlignedVector<float> d_attributes, d_clip_t;  // only if faces were clipped
  raster::ProjectBackwardScratch project;
};

// Gradients of the faces seen in one band of an image.
struct BandGradients {
  std::size_t stride = 0;
  AlignedVector<std::int32_t> faces;   // the faces of slots 1, 2, ...
  AlignedVector<float> values;         // as FinishBand writes them; never shrinks
  AlignedVector<std::int32_t> pieces;  // if faces were clipped: the piece visible at each pixel
};

// Gradients through the alpha of one bin of an image.
using BinGradients = AlignedVector<raster::SoftFaceGradient>;

struct WorkerScratch {
  std::size_t index;  // of the worker
  raster::VisibilityBin bin;
  AlignedVector<float> behind;  // for depth peeling, [kBinSize][kBinSize]
  raster::InterpolateScratch interpolate;
  raster::BandSums band;
  MergeScratch merge;
  RenderStats stats;
  RenderTimes times;
  // For a PixelStage: attributes of a strip, the faces of a strip in the backward pass, cotangents
  // of a band.
  AlignedVector<float> varyings, d_varyings;
  AlignedVector<std::int32_t> strip_faces;
  // For an image small enough to be one task: stays in the worker's cache.
  raster::DrawnFaces drawn_faces;
  raster::BinListBuffers drawn_buffers;
  BandGradients band_gradients;
  BinGradients bin_gradients;
};

// One bin of one image of the batch.
struct BinTask {
  std::size_t image, bin;
  raster::PixelRect rect;
};

}  // namespace tilegrad
