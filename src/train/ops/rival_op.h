// SPDX-License-Identifier: Apache-2.0
// The rivals' renderers (src/rivals) as an operation on the tape: meshes in, images out, the rule's
// own gradient back.
#pragma once

#include <span>
#include <vector>

#include "nn/tape.h"
#include "rivals/renderer.h"
#include "scene/camera.h"
#include "train/ops/render_op.h"

namespace tilegrad::train {

// What is the same for all meshes of a batch.
struct RivalJob {
  std::span<const std::int32_t> faces{};  // [F,3]; must outlive the tape
  std::vector<Camera>
      cameras;   // [N], N = B * views: mesh b has cameras [b * views, (b + 1) * views)
  int size = 0;  // pixels a side of the images
  rivals::Options options{};
};

// Reused from step to step. Holds the state of one rendering at a time, as SceneRenderer does
// (render_op.h).
struct RivalRenderer {
  explicit RivalRenderer(const Workers& workers) : renderer(workers), renderer64(workers) {}
  rivals::RendererT<float> renderer;
  rivals::RendererT<double> renderer64;
};

// textures: [B,F,texels,3], cubes of N3MR's faces, with Options::n3mr_colors. Otherwise as below.
RenderedImages RenderTextured(RivalRenderer& renderer, const nn::Var& positions,
                              const nn::Var& textures, RivalJob job);

// positions, and colors of vertices: [B,V,3]. An invalid `colors` draws alpha alone: the images'
// colors are then invalid, too. f64 draws SoftRas with the scalar reference (for proofs). Errors of
// shapes and options reach the context's status.
RenderedImages RenderRival(RivalRenderer& renderer, const nn::Var& positions, const nn::Var& colors,
                           RivalJob job);

}  // namespace tilegrad::train
