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
#include "fit/unknowns.h"
#include "nn/optim.h"
#include "train/losses/regularizers.h"

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
  RegularizerWeights regularizers;  // areas are shares of the start's
  double smoothing = 10;            // lambda of Diffusion
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

struct FitValues : StepValues {
  double image_loss = 0;  // the terms of images alone, weighted
};

// A block that moves.
struct FittedBlock : ParameterBlock {
  double learning_rate = 0;             // in the values' units
  nn::Var gradient = {};                // of the last Evaluate; 0 where no view saw the block
  std::unique_ptr<nn::Adam> adam = {};  // counts the steps of this block alone
};

class Fitter {
 public:
  // Errors name a parameter that no image depends on, and why. `workers` must outlive this.
  static Result<std::unique_ptr<Fitter>> Make(FitScene scene, const FitterOptions& options,
                                              const Workers& workers);
  Fitter(const Fitter&) = delete;
  Fitter& operator=(const Fitter&) = delete;

  // Loss before the step. Errors: those of the renderer; a loss or gradient that is not finite,
  // before anything is changed. The same sizes take nothing large from the heap.
  Result<FitValues> Step(const FitStep& step);
  // Loss and gradients, and no step.
  Result<FitValues> Evaluate(const FitStep& step);

  const FitScene& scene() const { return scene_; }
  const Images& images() const { return renderer_.frame.images(); }  // of the last step
  std::span<const FittedBlock> blocks() const { return blocks_; }

  // All that a later Step depends on, by name: values and moments of each block. And the faces,
  // for which they are.
  std::vector<nn::NamedTensor> State() const;
  Status LoadState(const std::vector<nn::NamedTensor>& state);

 private:
  Fitter(FitScene scene, const FitterOptions& options, const Workers& workers);
  nn::Var Loss(const FitStep& step, FitValues* values);
  Status CheckFinite(const FitValues& values) const;
  Status Move(FittedBlock* block, const FitStep& step);
  nn::StepMap* MapOf(Parameter what);

  FitScene scene_;
  const FitterOptions options_;
  nn::Context context_;
  SceneRenderer renderer_;
  const Unknowns unknowns_;
  const std::vector<Face> faces_;
  const Topology topology_;
  const nn::Tensor start_;  // positions
  const double start_area_;
  Diffusion diffusion_, color_diffusion_;
  std::vector<FittedBlock> blocks_;
};

}  // namespace tilegrad::train
