// SPDX-License-Identifier: Apache-2.0
// Alpha by the rule of the paper's implementations (AlphaRule::kPaper), forward and backward: for
// comparisons, so scalar code. Independent of the renderer's own soft mask.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "raster/project.h"
#include "raster/screen_mesh.h"
#include "raster/soft_mask/paper_ref.h"
#include "render/alpha/paper_tile.h"
#include "render/pipeline/records.h"

namespace tilegrad {

// 1 / delta, but no more than float can multiply by: the kernel is as sharp as pixels are long
// before, and infinity times the distance 0 is no number.
inline double InverseDelta(double delta) { return std::min(1 / delta, 1e30); }

inline raster::PaperSoftMask PaperRuleOf(const RenderOptions& options) {
  return {.inverse_delta = InverseDelta(options.delta),
          .box = options.paper_box,
          .max_faces = options.paper_faces};
}

template <class T>
raster::NdcFace<T> NdcFaceOf(const raster::ScreenMeshT<T>& mesh, std::size_t face) {
  raster::NdcFace<T> out;
  for (int k = 0; k < 3; ++k) {
    const auto v = static_cast<std::size_t>(mesh.vertex(face, k));
    out.x[k] = NdcX(mesh.x[v], mesh.width), out.y[k] = NdcY(mesh.y[v], mesh.height);
  }
  return out;
}

// Fills frame->alpha [N,H,W], given frame->face_ids. `scenes` are valid.
void PaperAlpha(std::span<const PipelineScene> scenes, const RenderOptions& options,
                const Workers& workers, PipelineFrame* frame);

// Adds the gradient of alpha to positions and cameras. d_alpha [N,H,W].
void PaperAlphaBackward(std::span<const PipelineScene> scenes, const RenderOptions& options,
                        const Workers& workers, const PipelineFrame& frame,
                        std::span<const float> d_alpha, std::span<PipelineGradients> d_scenes);

}  // namespace tilegrad
