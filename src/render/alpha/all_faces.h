// SPDX-License-Identifier: Apache-2.0
// Equation 6 over all faces, within RenderOptions::max_alpha_error (AlphaRule::kAllFaces): the
// vector kernels of raster/soft_mask/soft_mask.h. Alpha is 1 in the foreground.
#pragma once

#include <cstddef>
#include <vector>

#include "raster/soft_mask/soft_mask.h"
#include "render/alpha/stage.h"

namespace tilegrad {

class AllFacesAlpha final : public AlphaStage {
 public:
  explicit AllFacesAlpha(std::size_t workers) : scratch_(workers) {}

  AlphaNeeds needs() const override { return {.soft_tree = true, .transmittance = true}; }
  const char* name() const override { return "equation 6"; }
  void Begin(const RenderOptions& options, std::size_t images) override;
  void Prepare(std::size_t n, const ImageScratch& image) override;
  double Forward(const AlphaBin& bin, const AlphaImages& out) override;
  void Backward(const AlphaBin& bin, const AlphaAdjoint& adjoint, BinGradients* out) override;
  raster::SoftWork work() const override;

 private:
  const RenderOptions* options_ = nullptr;
  std::vector<raster::SoftMaskPlan> plans_;       // of images
  std::vector<raster::SoftMaskScratch> scratch_;  // of workers
};

}  // namespace tilegrad
