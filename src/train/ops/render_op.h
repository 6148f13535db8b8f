// SPDX-License-Identifier: Apache-2.0
// The renderer as an operation on the tape: predicted meshes in, images out, gradients back.
#pragma once

#include <span>
#include <vector>

#include "nn/tape.h"
#include "render/renderer.h"
#include "scene/camera.h"

namespace tilegrad::train {

struct RenderJob {
  std::span<const std::int32_t> faces;  // [F,3], shared by all meshes; must outlive the tape
  std::vector<Camera> cameras;  // [B * views]: mesh b has cameras [b * views, (b + 1) * views)
  int views = 1;
  RenderOptions options;
};

struct RenderedImages {
  nn::Var colors;  // [B * views, 3, H, W], 0 at background pixels
  nn::Var alpha;   // [B * views, H, W]
};

// A renderer with its images, reused from step to step so that a steady state takes nothing large
// from the heap. Holds the state of one rendering at a time: its way back is taken, or given up,
// before the next RenderMeshes.
struct MeshRenderer {
  explicit MeshRenderer(const Workers& workers)
      : renderer(RendererOn(workers)), renderer64(RendererOn<double>(workers)) {}
  Renderer renderer;
  RendererT<double> renderer64;
  Frame frame;
  FrameT<double> frame64;
};

// positions and colors: [B, V, 3]. f64 renders with the scalar reference (for proofs). Errors of
// the renderer reach the context's status. One call of `renderer` at a time, backward included.
RenderedImages RenderMeshes(MeshRenderer& renderer, const nn::Var& positions, const nn::Var& colors,
                            RenderJob job);

}  // namespace tilegrad::train
