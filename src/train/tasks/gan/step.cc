// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/gan/step.h"

#include "nn/nn.h"
#include "scene/camera_conventions.h"

namespace tilegrad::train {

GanStep::GanStep(nn::Context& context, const GanConfig& config, const CameraRule& rule)
    : context_(context),
      config_(config),
      size_(rule.lens.width),
      cameras_(PrimaryCameras(rule, config.views)),
      renderer_(context) {
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
  return RenderScenes(renderer_.Here(), scenes, std::move(job));
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

namespace {

// By GanCritic: random streams of weights and interpolates.
constexpr std::uint64_t kGanCriticStreams[] = {0x637368, 0x637063, 0x637478};
constexpr CriticRole kGanRoles[] = {
    {.prefix = "critic_shape.",
     .keys = "critic",
     .adversarial = {"adversarial_shape", "Adversarial loss of silhouettes (− mean score)"},
     .distance = {"distance_shape", "Wasserstein estimate of the critic of silhouettes"},
     .penalty = {"penalty_shape", "Gradient penalty of the critic of silhouettes"},
     .gradient = {"gradient_shape", "Norm of the gradient of the critic of silhouettes"}},
    {.prefix = "critic_picture.",
     .keys = "critic",
     .adversarial = {"adversarial_picture", "Adversarial loss of pictures (− mean score)"},
     .distance = {"distance_picture", "Wasserstein estimate of the critic of pictures"},
     .penalty = {"penalty_picture", "Gradient penalty of the critic of pictures"},
     .gradient = {"gradient_picture", "Norm of the gradient of the critic of pictures"}},
    {.prefix = "critic_texture.",
     .keys = "critic",
     .adversarial = {"adversarial_texture", "Adversarial loss of texture maps (− mean score)"},
     .distance = {"distance_texture", "Wasserstein estimate of the critic of texture maps"},
     .penalty = {"penalty_texture", "Gradient penalty of the critic of texture maps"},
     .gradient = {"gradient_texture", "Norm of the gradient of the critic of texture maps"}}};

// Half a map is its mirror image beyond its edges; a whole one goes around.
nn::CriticShape GanCriticShape(const GanConfig& config, GanCritic critic) {
  nn::CriticShape shape{.base = config.critic.base,
                        .halvings = static_cast<int>(config.critic.halvings)};
  if (critic == GanCritic::kSilhouettes) shape.in = config.views;
  if (critic == GanCritic::kPictures) shape.in = 3 * config.views;
  if (critic != GanCritic::kTextures) return shape;
  shape.padding_mode =
      config.network.symmetric_texture ? nn::PadMode::kReplicate : nn::PadMode::kCircular;
  return shape;
}

// A critic's rate, and no average: critics predict nothing.
OptimizerConfig GanCriticOptimizer(const GanConfig& config) {
  OptimizerConfig out = config.optimizer;
  out.learning_rate = config.critic.learning_rate;
  out.average = 0;
  return out;
}

}  // namespace

LearnedCritic::Job JobOf(const GanConfig& config, GanCritic critic) {
  const auto which = static_cast<std::size_t>(critic);
  return {.role = kGanRoles[which],
          .shape = GanCriticShape(config, critic),
          .game = {.penalty = config.critic.penalty, .place = PenaltyPlace::kInterpolates},
          .optimizer = GanCriticOptimizer(config),
          .steps = config.StageSteps(critic == GanCritic::kSilhouettes),
          .seed = static_cast<std::uint64_t>(config.schedule.seed),
          .weights = kGanCriticStreams[which],
          .interpolates = kGanCriticStreams[which]};
}

}  // namespace tilegrad::train
