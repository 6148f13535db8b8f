// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/gan/step.h"

#include <algorithm>

#include "nn/nn.h"
#include "scene/camera_conventions.h"

namespace tilegrad::train {

GanStep::GanStep(nn::Context& context, const GanConfig& config, const CameraRule& rule)
    : context_(context),
      config_(config),
      size_(rule.lens.width),
      cameras_(PrimaryCameras(rule, config.views)),
      renderer_(context.workers()) {
  for (Camera& camera : cameras_)
    camera = ScaledCamera(camera, static_cast<float>(config.stream.draw.samples));
}

nn::Tensor GanStep::Noise(std::uint64_t stream, std::uint64_t number, std::int64_t count) const {
  nn::Tensor noise = context_.Empty({count, config_.network.noise});
  Rng rng(static_cast<std::uint64_t>(config_.schedule.seed) ^ stream, number);
  nn::WithFloatType(noise.dtype(), [&]<class T>(T) {
    for (T& x : noise.span<T>()) x = static_cast<T>(rng.Normal());
  });
  return noise;
}

RenderedImages GanStep::Render(const SphereModel& sphere, const SceneVars& scenes) {
  const auto meshes = static_cast<std::size_t>(scenes.positions.shape()[0]);
  RenderJob job = sphere.Job(OptionsOf(config_.render, config_.render.sharpness,
                                       size_ * static_cast<int>(config_.stream.draw.samples)));
  job.views = static_cast<int>(cameras_.size());
  job.cameras.reserve(meshes * cameras_.size());
  for (std::size_t b = 0; b < meshes; ++b)
    job.cameras.insert(job.cameras.end(), cameras_.begin(), cameras_.end());
  return RenderScenes(renderer_, scenes, std::move(job));
}

// Each pixel the mean of its samples, the views of an object as channels.
nn::Var GanStep::Averaged(const nn::Var& images, std::int64_t channels) const {
  const auto samples = static_cast<int>(config_.stream.draw.samples);
  const std::int64_t side = size_ * samples;
  const nn::Var all = nn::Reshape(images, {-1, channels, side, side});
  return samples == 1 ? all : nn::AvgPool2d(all, {.kernel = samples, .stride = samples});
}

nn::Var GanStep::Colors(const ShapeTextureGenerator& generator, const nn::Var& positions,
                        const nn::Var& maps) {
  const SceneVars scenes{.positions = positions, .textures = generator.Textures(maps)};
  return Averaged(Render(generator.sphere(), scenes).colors, 3 * config_.views);
}

GeneratedObjects GanStep::Draw(ShapeTextureGenerator& generator, const nn::Tensor& noise,
                               GanStage stage, nn::Mode mode) {
  const nn::Var code = nn::Constant(context_, noise);
  GeneratedObjects out;
  out.shapes = generator.MakeShapes(code, mode);
  if (!out.shapes.positions.valid()) return out;
  if (stage == GanStage::kShape) {
    out.cover = Averaged(Render(generator.sphere(), {.positions = out.shapes.positions}).alpha,
                         config_.views);
    return out;
  }
  out.maps = generator.MakeMaps(code, mode);
  out.colors = Colors(generator, nn::Detach(out.shapes.positions), out.maps);
  return out;
}

ObjectViews GanStep::Show(ShapeTextureGenerator& generator, const nn::Tensor& noise,
                          Texture texture) {
  const nn::NoGrad off(context_);
  const nn::Var code = nn::Constant(context_, noise);
  const nn::Var positions = generator.MakeShapes(code, nn::Mode::kEval).positions;
  const nn::Var maps = texture == Texture::kMean ? generator.MeanMaps(noise.shape()[0])
                                                 : generator.MakeMaps(code, nn::Mode::kEval);
  if (!positions.valid() || !maps.valid()) return {};
  return {
      Colors(generator, positions, maps).value(),
      Averaged(Render(generator.sphere(), {.positions = positions}).alpha, config_.views).value()};
}

void GanStep::AddShapeLosses(const ShapeTextureGenerator& generator, const Prediction& shapes,
                             LossSum* sum) const {
  const SphereModel& sphere = generator.sphere();
  AddRegularizers(config_.loss,
                  {sphere.mesh().faces, sphere.topology(), shapes.positions, shapes.movement}, sum);
}

}  // namespace tilegrad::train
