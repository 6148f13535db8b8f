// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/textured_image/light_targets.h"

#include <algorithm>

namespace tilegrad::train {
namespace {

// The image that shows input m as the object's other input has it: see TexturedBatch.
constexpr std::size_t ImageFromOther(std::size_t m) { return 2 * (m ^ 1) + 1; }
static_assert(InputOfImage(ImageFromOther(6)) == 6 && InputOfImage(ImageFromOther(7)) == 7);

}  // namespace

LightTargets::LightTargets(nn::Context& context, double spread, double ambient)
    : context_(context), search_(spread, ambient), renderer_(context.workers()) {}

nn::Tensor LightTargets::Find(const PredictedObjects& objects, const TexturedBatch& batch,
                              RenderJob job) {
  job.shading.lighting = Lighting::kNone;
  job.normals = true;
  const std::size_t size = static_cast<std::size_t>(job.options.width), pixels = size * size;
  const SceneVars scenes{.positions = nn::Constant(context_, objects.positions.value()),
                         .textures = nn::Constant(context_, objects.textures.value())};
  if (!RenderScenes(renderer_, scenes, std::move(job)).colors.valid()) return {};
  nn::Tensor out = context_.Empty(objects.directions.shape(), objects.directions.dtype());
  nn::WithFloatType(out.dtype(), [&]<class T>(T) {
    const ImagesT<T>& drawn = FrameOf(renderer_, T{}).images();
    const std::span<const T> picture = batch.truth_colors.template span<T>();
    const std::span<const T> cover = batch.truth_alpha.template span<T>();
    context_.workers().For(batch.views.size(), [&](std::size_t m, std::size_t) {
      const std::size_t n = ImageFromOther(m);
      const auto planes = [&](std::span<const T> images) {
        return images.subspan(3 * n * pixels, 3 * pixels);
      };
      const auto found = search_.Find<T>({planes(drawn.color), planes(drawn.normals),
                                          planes(picture), cover.subspan(n * pixels, pixels)},
                                         batch.cameras[n].rotation);
      std::ranges::transform(found, out.data<T>() + 3 * m,
                             [](double x) { return static_cast<T>(x); });
    });
  });
  return out;
}

}  // namespace tilegrad::train
