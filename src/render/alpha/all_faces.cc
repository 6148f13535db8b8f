// SPDX-License-Identifier: Apache-2.0
#include "render/alpha/all_faces.h"

namespace tilegrad {

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

}  // namespace tilegrad
