// SPDX-License-Identifier: Apache-2.0
// Depth peeling for scenes with cut-out or transparent surfaces: draws them layer by layer from the
// front, so that every pixel gets its layers in the right order, whatever the order of faces in the
// file and however they intersect. Not differentiable.
#pragma once

#include <functional>
#include <vector>

#include "render/engine.h"

namespace tilegrad {

// How much a surface hides of what is behind it.
struct SurfaceCover {
  enum class Kind {
    kOpaque,  // everything
    kMask,    // everything where alpha >= `cutoff`; elsewhere the surface is absent
    kBlend    // a fraction equal to its alpha
  };
  Kind kind = Kind::kOpaque;
  float cutoff = 0.5f;

  float Of(float alpha) const;  // 0..1
};

struct SceneCover {
  Scene alpha;                         // the same faces, unlit, coloured by their alpha
  std::vector<SurfaceCover> surfaces;  // of the scene, indexed by face_surfaces
};

// Receives layers in order: called for each pixel that shows a face in this layer, with its index
// and the fraction that it hides of what is behind. Returns whether the pixel needs no more layers.
using TakeLayer = std::function<bool(const Images& layer, std::size_t pixel, float cover)>;

class LayerRenderer {
 public:
  explicit LayerRenderer(const Workers& workers) : engine_(workers) {}

  // Draws layer after layer of `scene` until every pixel is done, at most kMostLayers.
  Status Render(const Scene& scene, const SceneCover& cover, const RenderOptions& options,
                const Outputs& outputs, const TakeLayer& take);

  static constexpr int kMostLayers = 64;
  const PlanReport& plan() const { return plan_; }  // of the first layer

 private:
  Status DrawAlpha(const SceneCover& cover, const Camera& camera, const RenderOptions& options);
  Status RenderAll(const Scene& scene, const SceneCover& cover, const RenderOptions& options,
                   const Outputs& outputs, const TakeLayer& take);
  bool Visit(const Scene& scene, const SceneCover& cover, const TakeLayer& take);

  Engine engine_;
  FrameImages layer_, alpha_;
  PlanReport plan_;
};

}  // namespace tilegrad
