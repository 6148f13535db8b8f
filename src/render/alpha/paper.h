// SPDX-License-Identifier: Apache-2.0
// Alpha by the truncated rule of the paper's implementations (AlphaRule::kPaper,
// raster/soft_mask/paper_ref.h): for comparisons, so scalar code. Alpha is 1 in the foreground.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "raster/soft_mask/paper_ref.h"
#include "render/alpha/paper_bin.h"
#include "render/alpha/stage.h"

namespace tilegrad {

// 1 / delta, but no more than float can multiply by: the kernel is as sharp as pixels are long
// before, and infinity times the distance 0 is no number.
inline double InverseDelta(double delta) { return std::min(1 / delta, 1e30); }

inline raster::PaperSoftMask PaperRuleOf(const RenderOptions& options) {
  return {.inverse_delta = InverseDelta(options.delta),
          .box = options.paper_box,
          .max_faces = options.paper_faces};
}

// Sums its gradients by itself, tile after tile of the image.
class PaperAlpha final : public AlphaStage {
 public:
  AlphaNeeds needs() const override { return {.bounded = false, .own_sums = true}; }
  const char* name() const override { return "the paper's truncated rule"; }
  void Begin(const RenderOptions& options, std::size_t images) override;
  void Prepare(std::size_t n, const ImageScratch& image) override;
  double Forward(const AlphaBin& bin, const AlphaImages& out) override;
  void Backward(const AlphaBin& bin, const AlphaAdjoint& adjoint, BinGradients* out) override;
  void AddToScene(const PipelineScene& scene, std::size_t n, const ImageScratch& image,
                  PipelineGradients* d_scene) const override;

 private:
  // The faces that take part, in their order, and the gradients of those near the tiles of a bin.
  struct Image {
    std::vector<std::int32_t> ids;  // of the mesh
    std::vector<raster::NdcFace<float>> faces;
    std::vector<std::vector<NearFacesT<float>>> bins;
  };

  PaperRegion RegionOf(const AlphaBin& bin, std::span<const std::int32_t> face_ids) const;

  const RenderOptions* options_ = nullptr;
  std::vector<Image> images_;
};

}  // namespace tilegrad
