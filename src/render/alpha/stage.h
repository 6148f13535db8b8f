// SPDX-License-Identifier: Apache-2.0
// A rule that makes alpha, as a stage of the pipeline beside PixelStage. How to add one:
// docs/adding.md.
//
// A call of the pipeline runs Begin once; Prepare once per image; then Forward or Backward for each
// bin, in any order and by any worker; then, if the rule asks for it, AddToScene once per image.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "raster/soft_mask/setup.h"
#include "render/pipeline/image_scratch.h"
#include "render/pipeline/records.h"

namespace tilegrad {

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

}  // namespace tilegrad
