// SPDX-License-Identifier: Apache-2.0
// The stages that a Pipeline composes (pipeline.cc): prepare an image, scene -> screen -> bins;
// draw bins, interpolate, compute alpha; in the backward pass propagate bands and bins to faces,
// and their sums to the scene. A stage knows one image, or a part of one.
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

// A rule for alpha, a pipeline stage beside PixelStage. How to add one: docs/adding.md.
//
// A pipeline call runs Begin once; Prepare once per image; then Forward or Backward for each bin,
// in any order and by any worker; then, if the rule requests it, AddToScene once per image.

// What a rule needs from the pipeline, the same in every call.
struct AlphaNeeds {
  bool soft_tree = false;      // build ImageScratch::soft before Prepare
  bool transmittance = false;  // allocate FrameImages::transmittance, returned in AlphaAdjoint
  bool bounded = true;         // false: Frame::alpha_error_bound is infinite, whatever Forward says
  bool own_sums = false;       // gradients go through AddToScene, not through BinGradients
};

// A bin of an image, and the image on the screen: all of its faces (image.mesh), and the tree of
// those that take part in alpha (image.soft). The depth of a visible face is raster::MakeDepthPlane
// of raster::PieceAt(image.mesh, face id, column, row).
struct AlphaBin {
  const ImageScratch& image;
  const BinTask& task;
  std::size_t worker;  // selects scratch
};

// Whole images [H,W]; a task may read all const arrays, and writes only the pixels of its bin.
struct AlphaImages {
  std::span<const std::int32_t> face_ids;  // of the scene's faces; < 0 is background. In Forward
                                           // only those of the bin are valid
  std::span<float> alpha;
  std::span<float> transmittance;  // as needs() asks
};
struct AlphaAdjoint {
  std::span<const std::int32_t> face_ids;
  std::span<const float> alpha;          // as written by Forward
  std::span<const float> transmittance;  // likewise; may be empty
  std::span<const float> d_alpha;        // finite, unless the call fails anyway
};

class AlphaStage {
 public:
  virtual ~AlphaStage() = default;

  virtual AlphaNeeds needs() const = 0;
  // The rule's name for `--explain`.
  virtual const char* name() const = 0;
  // Starts a call. `options` are valid, and outlive it.
  virtual void Begin(const RenderOptions& options, std::size_t images) = 0;
  // Image n of the batch was projected. Skipped if it is reused from the last call, with the same
  // scene and options: prepared data stays valid until the next Prepare.
  virtual void Prepare(std::size_t n, const ImageScratch& image) = 0;
  // Writes alpha of all pixels of the bin, foreground included. Returns the error spent, a bound on
  // |alpha - the rule's equation|.
  virtual double Forward(const AlphaBin& bin, const AlphaImages& out) = 0;
  // Appends dL/d(corners) of faces of the screen mesh to `out`, initially empty, in an order that
  // depends on the scene only. A rule that computes gradients per face rather than per pixel
  // handles the bin's share of faces: bins of an image are numbered from 0.
  virtual void Backward(const AlphaBin& bin, const AlphaAdjoint& adjoint, BinGradients* out) = 0;
  // With needs().own_sums: adds the gradients of an image's bins to positions and d_camera, if
  // requested, after those of attributes.
  virtual void AddToScene(const PipelineScene& /*scene*/, std::size_t /*n*/,
                          const ImageScratch& /*image*/, PipelineGradients* /*d_scene*/) const {}
  // Work counted in this call.
  virtual raster::SoftWork work() const { return {}; }
};

// The rules: AlphaRule::kAllFaces, with scratch for each of `workers`, and kPaper.
std::unique_ptr<AlphaStage> MakeAllFacesAlpha(std::size_t workers);
std::unique_ptr<AlphaStage> MakePaperAlpha();

struct PrepareRequest {
  bool drawn_bins = true;       // visibility will run
  AlphaStage* alpha = nullptr;  // alpha or its gradient will run, by this rule
  bool reuse = false;           // reuse the last preparation if scene and options are the same
};

struct SceneToPrepare {
  std::size_t n;  // of the batch
  const PipelineScene& scene;
  const FaceTopology& topology;  // of its faces
};

void PrepareImage(const SceneToPrepare& in, const RenderOptions& options,
                  const PrepareRequest& request, const Workers& workers, ImageScratch* image,
                  RenderStats* stats);

// Prepares the attributes that a stage needs again in the backward pass. `image` is prepared.
void PrepareRecomputed(const PipelineScene& scene, ImageScratch* image);

// Common input of the bins of an image.
struct BinInput {
  const PipelineScene& scene;
  const RenderOptions& options;
  const ImageScratch& image;
  AlignedVector<float>* attributes;  // destination; null: a stage takes attributes, or nobody
  PixelStage* stage;                 // takes attributes; null: none
  AlphaStage* alpha;                 // null: not requested
};

// Writes the bin's pixels into every image that `frame` has. Returns the error spent by alpha.
// task.bin and task.rect are those of raster::BinGrid.
double RenderBin(const BinInput& input, const BinTask& task, WorkerScratch* worker,
                 FrameImages* frame);

// The bands of an image: whole rows, so that few faces span several; short enough to share one
// large image among workers. They depend on the image size only.
struct BandGrid {
  int width, height, rows;  // pixels; a band has `rows` rows, the last may have fewer

  BandGrid(int w, int h) : width(w), height(h), rows(std::clamp(kBandPixels / w, 16, 64)) {}
  std::size_t count() const { return static_cast<std::size_t>((height + rows - 1) / rows); }

 private:
  static constexpr int kBandPixels = 1 << 15;
};

// Input of a backward task.
struct BackwardInput {
  const RenderOptions& options;
  const FrameImages& frame;
  const PipelineCotangents& d_frame;
  PixelStage* stage;  // null: d_frame holds the cotangents of attributes
  AlphaStage* alpha;  // null: alpha has no gradient
};

// One band of one image of the batch.
struct BandTask {
  std::size_t image, band;
};

// Gradients of the faces visible in a band, through their attributes. Returns false, and does
// nothing else, if a cotangent in the band is not finite.
bool RenderBandBackward(const BackwardInput& input, const ImageScratch& image, const BandTask& task,
                        const raster::BackwardRequest& request, WorkerScratch* worker,
                        BandGradients* out);

// Gradients of faces through the alpha of a bin, by the alpha rule.
void RenderBinBackward(const BackwardInput& input, const ImageScratch& image, const BinTask& bin,
                       WorkerScratch* worker, BinGradients* out);

// Merging sums in the order of bands, bins and their faces, whichever worker computed them.

// The gradients of an image's parts; a span is empty if parts of that kind have none.
struct ImageGradients {
  std::span<const BandGradients> bands;
  std::span<const BinGradients> bins;
  raster::BackwardRequest request;  // the request that the bands were given
};

// Overwrites d_vertices [V][4], d_x, d_y, d_inverse_depth, 0 of the vertices of the screen mesh,
// with the sum of the given bands and bins. Shares nothing but the image with other tasks.
void SumGeometry(const ImageScratch& image, const ImageGradients& gradients,
                 AlignedVector<float>* d_vertices);

// From such sums over all bands and bins: overwrites d_scene's positions and d_camera, if
// requested. Returns whether all written numbers are finite.
bool MergeGeometry(const PipelineScene& scene, const RenderOptions& options,
                   const ImageScratch& image, const ImageGradients& gradients,
                   std::span<const float> d_vertices, WorkerScratch* worker,
                   PipelineGradients* d_scene);

// Whether the written gradients of positions and camera are finite.
bool IsFiniteGeometry(const PipelineGradients& d_scene);

// Overwrites d_scene's attributes, if requested. For a clipped mesh MergeGeometry does this, since
// attributes at the cut depend on geometry.
bool MergeAttributes(const ImageScratch& image, const ImageGradients& gradients,
                     WorkerScratch* worker, PipelineGradients* d_scene);

}  // namespace tilegrad
