// SPDX-License-Identifier: Apache-2.0
#include "render/picture/layers.h"

#include <algorithm>
#include <limits>

#include "base/error.h"

namespace tilegrad {

float SurfaceCover::Of(float alpha) const {
  if (kind == Kind::kOpaque) return 1;
  if (kind == Kind::kMask) return alpha >= cutoff ? 1.0f : 0.0f;
  return std::clamp(alpha, 0.0f, 1.0f);
}

Status LayerRenderer::DrawAlpha(const SceneCover& cover, const Camera& camera,
                                const RenderOptions& options) {
  Scene scene = cover.alpha;
  scene.camera = camera;
  Outputs outputs;
  outputs.attributes = outputs.alpha = false;
  return engine_.Render({&scene, 1}, options, outputs, &alpha_);
}

// Reports what this layer shows, and opens unfinished pixels to the next one. Returns whether there
// are any.
bool LayerRenderer::Visit(const Scene& scene, const SceneCover& cover, const TakeLayer& take) {
  const Images images = ImagesOf(layer_);
  bool any = false;
  for (std::size_t at = 0; at < images.face_ids.size(); ++at) {
    const std::int32_t face = images.face_ids[at];
    if (face < 0) continue;
    const auto surface =
        scene.face_surfaces.empty()
            ? std::size_t{0}
            : static_cast<std::size_t>(scene.face_surfaces[static_cast<std::size_t>(face)]);
    const bool done = take(images, at, cover.surfaces[surface].Of(alpha_.color[at]));
    if (done) layer_.peeled[at] = 0;
    any |= !done;
  }
  return any;
}

Status LayerRenderer::RenderAll(const Scene& scene, const SceneCover& cover,
                                const RenderOptions& options, const Outputs& outputs,
                                const TakeLayer& take) {
  const auto pixels =
      static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height);
  layer_.peeled.assign(pixels, std::numeric_limits<float>::infinity());
  for (int layer = 0; layer < kMostLayers; ++layer) {
    alpha_.peeled = layer_.peeled;
    TILEGRAD_TRY(engine_.Render({&scene, 1}, options, outputs, &layer_));
    if (layer == 0) plan_ = engine_.Explain();
    TILEGRAD_TRY(DrawAlpha(cover, scene.camera, options));
    if (!Visit(scene, cover, take)) break;
  }
  return {};
}

Status LayerRenderer::Render(const Scene& scene, const SceneCover& cover,
                             const RenderOptions& options, const Outputs& outputs,
                             const TakeLayer& take) {
  return Guarded([&] { return RenderAll(scene, cover, options, outputs, take); });
}

}  // namespace tilegrad
