// SPDX-License-Identifier: Apache-2.0
// Equation 6 over all faces, within RenderOptions::max_alpha_error (AlphaRule::kAllFaces): the
// vector kernels of raster/soft_mask/soft_mask.h. Alpha is 1 in the foreground.
#include <cstddef>
#include <memory>
#include <vector>

#include "raster/soft_mask/soft_mask.h"
#include "render/alpha/stage.h"

namespace tilegrad {
namespace {

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

void AllFacesAlpha::Begin(const RenderOptions& options, std::size_t images) {
  options_ = &options;
  if (plans_.size() < images) plans_.resize(images);
  for (raster::SoftMaskScratch& scratch : scratch_) scratch.work = {};
}

void AllFacesAlpha::Prepare(std::size_t n, const ImageScratch& image) {
  plans_[n] = raster::PlanSoftMask({options_->width, options_->height, options_->delta,
                                    options_->max_alpha_error, image.soft.faces});
}

double AllFacesAlpha::Forward(const AlphaBin& bin, const AlphaImages& out) {
  return raster::SoftMaskForward(bin.image.soft, plans_[bin.task.image],
                                 {bin.task.rect, out.face_ids}, {out.alpha, out.transmittance},
                                 &scratch_[bin.worker]);
}

void AllFacesAlpha::Backward(const AlphaBin& bin, const AlphaAdjoint& adjoint, BinGradients* out) {
  raster::SoftMaskBackward(
      bin.image.soft, plans_[bin.task.image], {bin.task.rect, adjoint.face_ids},
      {adjoint.alpha, adjoint.transmittance, adjoint.d_alpha}, out, &scratch_[bin.worker]);
}

raster::SoftWork AllFacesAlpha::work() const {
  raster::SoftWork sum;
  for (const raster::SoftMaskScratch& scratch : scratch_) {
    sum.pairs += scratch.work.pairs;
    sum.powers += scratch.work.powers;
  }
  return sum;
}

}  // namespace

std::unique_ptr<AlphaStage> MakeAllFacesAlpha(std::size_t workers) {
  return std::make_unique<AllFacesAlpha>(workers);
}

}  // namespace tilegrad
