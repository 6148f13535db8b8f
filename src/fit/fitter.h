// SPDX-License-Identifier: Apache-2.0
// Gradient descent on a scene: render some views, hold them to images, take the gradient back,
// step.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "fit/diffusion.h"
#include "fit/image_loss.h"
#include "fit/parameter_block.h"
#include "fit/regularizer.h"
#include "nn/layers.h"

namespace tilegrad::train {

// Learning rates by parameter: world units, colours and texels in [0, 1], uv, radians and world
// units of cameras, unit directions, coefficients, factors, logarithms of gains and of focal
// lengths.
struct LearningRates {
  std::array<double, kParameters.size()> of = {0.03, 0.02, 0.02, 0.005, 0.005,
                                               0.02, 0.02, 0.02, 0.01,  0.002};
  double operator[](Parameter p) const { return of[static_cast<std::size_t>(p)]; }
  double& operator[](Parameter p) { return of[static_cast<std::size_t>(p)]; }
};

struct FitterOptions {
  ParameterSet parameters;
  LearningRates rates;
  ImageLoss loss;
  RegularizerTerms regularizers;
  double smoothing = 10;  // lambda of Diffusion
  // The view whose gain stays, where exposures are fitted: else colours and gains could share any
  // factor.
  int exposure_reference = 0;
  // Lambda of the same for vertex colours, which then take one step size: those that are hardly
  // seen move little, with their neighbours. None: each colour has a step size of its own.
  std::optional<double> color_smoothing;
};

// One step: views of the scene, and the images that show them at `render`'s size.
struct FitStep {
  std::span<const int> views;
  const TargetImages* targets = nullptr;
  FitRenderer::Job job;  // `views` is set from above
  double rate_factor = 1;
  double area_factor = 1;     // of the weight of the surface's area
  double texture_factor = 1;  // of texels and vertex colours, beside that; 0: they rest
  double light_factor = 1;    // of lights, harmonics and materials, beside that
  double position_factor = 1;
  double camera_factor = 1;  // of cameras and focal lengths, beside that; 0: they rest
};

struct FitValues {
  ImageLossValue image;
  RegularizerTerms regularizers;
  double total = 0;  // weighted
};

class Fitter {
 public:
  // Errors name a parameter that no image depends on, and why. `workers` must outlive this.
  static Result<Fitter> Make(FitScene scene, const FitterOptions& options, const Workers& workers);

  // Loss before the step. Errors: those of the renderer; a loss or gradient that is not finite,
  // before anything is changed. The same sizes allocate nothing.
  Result<FitValues> Step(const FitStep& step);
  // Loss and gradients, and no step.
  Result<FitValues> Evaluate(const FitStep& step);

  const FitScene& scene() const { return scene_; }
  const Images& images() const { return renderer_->images(); }  // of the last step
  const ImageLossRule& rule() const { return rule_; }
  std::span<const ParameterBlock> blocks() const { return blocks_; }

  // All that a later Step depends on, by name: values and moments of each block, connectivity and
  // texture coordinates.
  std::vector<nn::NamedTensor> State(nn::Context& context) const;
  Status LoadState(std::span<const nn::NamedTensor> state);

 private:
  Fitter(FitScene scene, const FitterOptions& options, const Workers& workers);
  Status LoadMesh(std::span<const nn::NamedTensor> state);
  Status CheckFinite(const FitValues& values) const;
  Status Move(ParameterBlock* block, const FitStep& step);
  Diffusion* SmoothingOf(Parameter what);
  template <class Visit>
  void ForEachOfViews(std::span<const int> views, const Visit& visit);

  FitScene scene_;
  FitterOptions options_;
  const Workers* workers_;
  std::unique_ptr<FitRenderer> renderer_;
  FitGradients gradients_;
  ImageLossRule rule_;
  Regularizer regularizer_;
  Diffusion diffusion_, color_diffusion_;
  std::vector<ParameterBlock> blocks_;
};

}  // namespace tilegrad::train
