// SPDX-License-Identifier: Apache-2.0
// The forward pass of the generator of section 5.5: noise -> shape and texture -> pictures of each
// object -> critics. First the shapes are trained, through silhouettes; then they are frozen, and
// the textures are trained.
#pragma once

#include <vector>

#include "train/losses/loss_sum.h"
#include "train/models/render_op.h"
#include "train/tasks/gan/config.h"
#include "train/tasks/gan/real_samples.h"
#include "train/tasks/learned_weights.h"

namespace tilegrad::train {

// Critics of silhouettes in all views, of colours in all views (D_I), of texture maps (D_t).
enum class GanCritic { kSilhouettes, kPictures, kTextures };

LearnedCritic::Job JobOf(const GanConfig& config, GanCritic critic);

enum class GanStage { kShape, kTexture };

// What critics see of a batch of B objects in V views.
struct GeneratedObjects {
  Prediction shapes;
  nn::Var maps;    // texture stage only
  nn::Var cover;   // [B, V, size, size]; shape stage only
  nn::Var colors;  // [B, 3 V, size, size], RGB over black; texture stage only
};

class GanStep {
 public:
  // Cameras are PrimaryCameras of `rule`, whose images are square.
  GanStep(nn::Context& context, const GanConfig& config, const CameraRule& rule);

  // Standard normal [count, noise], a function of the seed, the stream and the number.
  nn::Tensor Noise(std::uint64_t stream, std::uint64_t number, std::int64_t count) const;
  // On the tape; one call at a time, because the images belong to one renderer. Gradients reach
  // what the stage trains.
  GeneratedObjects Draw(ShapeTextureGenerator& generator, const nn::Tensor& noise, GanStage stage,
                        nn::Mode mode);
  // Cover and colours without gradient, in eval mode.
  enum class Texture { kOwn, kMean };
  ObjectViews Show(ShapeTextureGenerator& generator, const nn::Tensor& noise,
                   Texture texture = Texture::kOwn);

  void AddShapeLosses(const ShapeTextureGenerator& generator, const Prediction& shapes,
                      LossSum* sum) const;

 private:
  RenderedImages Render(const SphereModel& sphere, const SceneVars& scenes);
  nn::Var Colors(const ShapeTextureGenerator& generator, const nn::Var& positions,
                 const nn::Var& maps);
  nn::Var Averaged(const nn::Var& images, std::int64_t channels) const;

  nn::Context& context_;
  GanConfig config_;
  int size_;
  std::vector<Camera> cameras_;  // supersampled: `samples` pixels a side of each pixel
  nn::PerLane<SceneRenderer> renderer_;
};

}  // namespace tilegrad::train
