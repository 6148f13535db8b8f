// SPDX-License-Identifier: Apache-2.0
// The stages that a Pipeline composes (pipeline.cc): an image is prepared, scene -> screen -> bins;
// its bins are drawn, interpolated and given their alpha; on the way back its bands of rows and its
// bins are taken to faces, and their sums to the scene. A stage knows one image, or a part of one.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "raster/soft_mask/setup.h"
#include "render/frame_images.h"
#include "render/pipeline/image_scratch.h"
#include "render/pipeline/records.h"

namespace tilegrad {

// A rule that makes alpha, as a stage of the pipeline beside PixelStage. How to add one:
// docs/adding.md.
//
// A call of the pipeline runs Begin once; Prepare once per image; then Forward or Backward for each
// bin, in any order and by any worker; then, if the rule asks for it, AddToScene once per image.

// What a rule asks of the pipeline, the same in every call.
struct AlphaNeeds {
  bool soft_tree = false;  // ImageScratch::soft is built before Prepare
  bool transmittance =
      false;              // FrameImages::transmittance has room, and comes back in AlphaAdjoint
  bool bounded = true;    // false: Frame::alpha_error_bound is infinite, whatever Forward says
  bool own_sums = false;  // gradients go through AddToScene, not through BinGradients
};

// A bin of an image, and the image on the screen: all of its faces (image.mesh), and those that
// take part in alpha as a tree (image.soft). The depth of the face that a pixel shows is
// raster::MakeDepthPlane of raster::PieceAt(image.mesh, face id, column, row).
struct AlphaBin {
  const ImageScratch& image;
  const BinTask& task;
  std::size_t worker;  // selects scratch
};

// Whole images [H,W]; a task may read all of what is const, and writes the pixels of its bin only.
struct AlphaImages {
  std::span<const std::int32_t> face_ids;  // of the scene's faces; < 0 is background. Forward: only
                                           // those of the bin are there
  std::span<float> alpha;
  std::span<float> transmittance;  // as needs() asks
};
struct AlphaAdjoint {
  std::span<const std::int32_t> face_ids;
  std::span<const float> alpha;          // as Forward wrote it
  std::span<const float> transmittance;  // likewise; may be empty
  std::span<const float> d_alpha;        // finite, unless the call fails anyway
};

class AlphaStage {
 public:
  virtual ~AlphaStage() = default;

  virtual AlphaNeeds needs() const = 0;
  // What `--explain` calls the rule.
  virtual const char* name() const = 0;
  // What the next call is about. `options` are valid, and the caller keeps them until it ends.
  virtual void Begin(const RenderOptions& options, std::size_t images) = 0;
  // Image n of the batch was put on the screen. Left out where it still is from the last call, for
  // the same scene and options: what was prepared stays until it is prepared again.
  virtual void Prepare(std::size_t n, const ImageScratch& image) = 0;
  // Writes alpha of all pixels of the bin, foreground as well. Returns the error spent, a bound on
  // |alpha - the rule's equation|.
  virtual double Forward(const AlphaBin& bin, const AlphaImages& out) = 0;
  // Appends dL/d(corners) of faces of the screen mesh to `out`, which is empty, in an order that
  // depends on the scene only. A rule whose gradient goes by faces rather than by pixels takes the
  // bin's share of them: bins of an image are numbered from 0.
  virtual void Backward(const AlphaBin& bin, const AlphaAdjoint& adjoint, BinGradients* out) = 0;
  // With needs().own_sums: adds the gradients of an image's bins to positions and d_camera, where
  // they are wanted, after those of attributes.
  virtual void AddToScene(const PipelineScene& /*scene*/, std::size_t /*n*/,
                          const ImageScratch& /*image*/, PipelineGradients* /*d_scene*/) const {}
  // What was evaluated in this call.
  virtual raster::SoftWork work() const { return {}; }
};

// The rules: AlphaRule::kAllFaces, with scratch for each of so many workers, and kPaper.
std::unique_ptr<AlphaStage> MakeAllFacesAlpha(std::size_t workers);
std::unique_ptr<AlphaStage> MakePaperAlpha();

struct PrepareRequest {
  bool drawn_bins = true;       // visibility will run
  AlphaStage* alpha = nullptr;  // alpha or its gradient will run, by this rule
  bool reuse = false;           // what was prepared last, if it was for the same scene and options
};

struct SceneToPrepare {
  std::size_t n;  // of the batch
  const PipelineScene& scene;
  const FaceTopology& topology;  // of its faces
};

void PrepareImage(const SceneToPrepare& in, const RenderOptions& options,
                  const PrepareRequest& request, const Workers& workers, ImageScratch* image,
                  RenderStats* stats);

// The attributes that a stage needs again on the way back. `image` is prepared.
void PrepareRecomputed(const PipelineScene& scene, ImageScratch* image);

// What the bins of an image have in common.
struct BinInput {
  const PipelineScene& scene;
  const RenderOptions& options;
  const ImageScratch& image;
  AlignedVector<float>* attributes;  // the image that attributes are; null: there is a stage, or
                                     // none is wanted
  PixelStage* stage;                 // of attributes; null: none
  AlphaStage* alpha;                 // null: not wanted
};

// Writes the bin's pixels into every image that `frame` has. Returns the error that alpha spent.
// task.bin and task.rect are those of raster::BinGrid.
double RenderBin(const BinInput& input, const BinTask& task, WorkerScratch* worker,
                 FrameImages* frame);

// The bands of an image: whole rows, so that faces are cut seldom; short enough to share one large
// image among workers. They depend on the size of the image only.
struct BandGrid {
  int width, height, rows;  // pixels; a band has `rows` rows, the last may have fewer

  BandGrid(int w, int h) : width(w), height(h), rows(std::clamp(kBandPixels / w, 16, 64)) {}
  std::size_t count() const { return static_cast<std::size_t>((height + rows - 1) / rows); }

 private:
  static constexpr int kBandPixels = 1 << 15;
};

// What a task of the backward pass reads.
struct BackwardInput {
  const RenderOptions& options;
  const FrameImages& frame;
  const PipelineCotangents& d_frame;
  PixelStage* stage;  // null: cotangents of attributes are images themselves
  AlphaStage* alpha;  // null: alpha has no gradient
};

// One band of one image of the batch.
struct BandTask {
  std::size_t image, band;
};

// Gradients of the faces seen in a band, through their attributes. Returns false, and does nothing
// else, if a cotangent in the band is not finite.
bool RenderBandBackward(const BackwardInput& input, const ImageScratch& image, const BandTask& task,
                        const raster::BackwardRequest& request, WorkerScratch* worker,
                        BandGradients* out);

// Gradients of faces through the alpha of a bin, with a rule.
void RenderBinBackward(const BackwardInput& input, const ImageScratch& image, const BinTask& bin,
                       WorkerScratch* worker, BinGradients* out);

// Merging makes sums in the order of bands, bins and their faces, whoever computed them.

// The gradients of an image, one span per kind of part; empty where that part of the image has no
// gradient.
struct ImageGradients {
  std::span<const BandGradients> bands;
  std::span<const BinGradients> bins;
  raster::BackwardRequest request;  // what the bands were asked for
};

// Overwrites d_vertices [V][4], d_x, d_y, d_inverse_depth, 0 of the vertices of the screen mesh,
// with what the bands and bins that are given add up to. Nothing but the image is shared with
// others.
void SumGeometry(const ImageScratch& image, const ImageGradients& gradients,
                 AlignedVector<float>* d_vertices);

// From such sums of all bands and bins: overwrites d_scene's positions and d_camera, where they are
// wanted. Returns whether all that it has written is finite.
bool MergeGeometry(const PipelineScene& scene, const RenderOptions& options,
                   const ImageScratch& image, const ImageGradients& gradients,
                   std::span<const float> d_vertices, WorkerScratch* worker,
                   PipelineGradients* d_scene);

// Whether what was written of positions and the camera is finite.
bool IsFiniteGeometry(const PipelineGradients& d_scene);

// Overwrites d_scene's attributes, if they are wanted. Of a mesh that was cut, that is done by
// MergeGeometry, since attributes at the cut depend on geometry.
bool MergeAttributes(const ImageScratch& image, const ImageGradients& gradients,
                     WorkerScratch* worker, PipelineGradients* d_scene);

}  // namespace tilegrad
