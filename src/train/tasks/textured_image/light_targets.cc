// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/textured_image/light_targets.h"

#include <algorithm>

namespace tilegrad::train {
namespace {

// The image that shows input m as the object's other input has it: see TexturedBatch.
constexpr std::size_t ImageFromOther(std::size_t m) { return 2 * (m ^ 1) + 1; }
static_assert(InputOfImage(ImageFromOther(6)) == 6 && InputOfImage(ImageFromOther(7)) == 7);

template <class T>
struct TargetRow {
  const T* said;
  T* out;
  std::size_t numbers;  // 3: a direction, 9: harmonics
};

template <class T>
void Write(const FoundLight& found, const TargetRow<T>& row) {
  const auto& d = found.direction;
  if (d == std::array<double, 3>{}) {
    std::copy_n(row.said, row.numbers, row.out);
  } else if (row.numbers == 3) {
    std::ranges::transform(d, row.out, [](double x) { return static_cast<T>(x); });
  } else {
    const auto sh = SkyAndLight(
        found.sky, {static_cast<float>(d[0]), static_cast<float>(d[1]), static_cast<float>(d[2])});
    std::ranges::transform(sh, row.out, [](float x) { return static_cast<T>(x); });
  }
}

}  // namespace

LightTargets::LightTargets(nn::Context& context, const LightConfig& config)
    : context_(context), search_(config), renderer_(context.workers()) {}

nn::Tensor LightTargets::Find(const Prediction& objects, const TexturedBatch& batch,
                              RenderJob job) {
  job.shading.lighting = Lighting::kNone;
  job.normals = true;
  const std::size_t size = static_cast<std::size_t>(job.options.width), pixels = size * size;
  const SceneVars scenes{.positions = nn::Constant(context_, objects.positions.value()),
                         .textures = nn::Constant(context_, objects.textures.value())};
  if (!RenderScenes(renderer_, scenes, std::move(job)).colors.valid()) return {};
  const nn::Tensor said = PredictedLights(objects).value();
  nn::Tensor out = context_.Empty(said.shape(), said.dtype());
  nn::WithFloatType(out.dtype(), [&]<class T>(T) {
    const ImagesT<T>& drawn = FrameOf(renderer_, T{}).images();
    const std::span<const T> picture = batch.truth_colors.template span<T>();
    const std::span<const T> cover = batch.truth_alpha.template span<T>();
    context_.workers().For(batch.views.size(), [&](std::size_t m, std::size_t) {
      const std::size_t n = ImageFromOther(m);
      const auto planes = [&](std::span<const T> images) {
        return images.subspan(3 * n * pixels, 3 * pixels);
      };
      const FoundLight found = search_.Find<T>({planes(drawn.color), planes(drawn.normals),
                                                planes(picture), cover.subspan(n * pixels, pixels)},
                                               batch.cameras[n].rotation);
      const auto numbers = static_cast<std::size_t>(said.shape()[1]);
      Write<T>(found, {said.data<T>() + numbers * m, out.data<T>() + numbers * m, numbers});
    });
  });
  return out;
}

}  // namespace tilegrad::train
