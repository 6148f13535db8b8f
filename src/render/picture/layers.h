// SPDX-License-Identifier: Apache-2.0
// Scenes whose surfaces have holes or let light through, drawn layer by layer from the front (depth
// peeling): every pixel sees its own layers in the right order, however faces lie in the file or
// cut each other. Not differentiable.
#pragma once

#include <functional>
#include <vector>

#include "render/engine.h"

namespace tilegrad {

// How much of what is behind a surface it hides.
struct SurfaceCover {
  enum class Kind {
    kOpaque,  // everything
    kMask,    // everything where its alpha is at least `cutoff`; elsewhere it is not there
    kBlend    // the share that its alpha is
  };
  Kind kind = Kind::kOpaque;
  float cutoff = 0.5f;

  float Of(float alpha) const;  // 0..1
};

struct SceneCover {
  Scene alpha;                         // the same faces, unlit, coloured by their alpha
  std::vector<SurfaceCover> surfaces;  // of the scene, as face_surfaces has them
};

// What is seen, in the order of layers: of each pixel that shows a face in this layer, its index,
// and the share of what is behind that it hides. Returns whether the pixel needs no layer more.
using TakeLayer = std::function<bool(const Images& layer, std::size_t pixel, float cover)>;

class LayerRenderer {
 public:
  explicit LayerRenderer(const Workers& workers) : engine_(workers) {}

  // Draws image after image of `scene`, until every pixel is done. Behind kMostLayers faces nothing
  // is drawn.
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
