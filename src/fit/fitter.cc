// SPDX-License-Identifier: Apache-2.0
#include "fit/fitter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/array_checks.h"
#include "base/error.h"
#include "train/losses/area_edge_length.h"

namespace tilegrad::train {
namespace {

// Losses are means over pixels: their gradients are small beside the usual epsilon.
constexpr nn::AdamOptions kAdam = {.beta1 = 0.9, .beta2 = 0.999, .epsilon = 1e-12};

constexpr const char* kFaces = "mesh.faces";

double FactorOf(const FitStep& step, Parameter what) {
  switch (what) {
    case Parameter::kCamera:
    case Parameter::kFocal:
      return step.camera_factor;
    case Parameter::kColors:
    case Parameter::kTexture:
      return step.texture_factor;
    case Parameter::kLight:
    case Parameter::kSh:
    case Parameter::kMaterial:
      return step.light_factor;
    case Parameter::kPositions:
      return step.position_factor;
    default:
      return 1;
  }
}

std::vector<Face> FacesOf(std::span<const std::int32_t> corners) {
  std::vector<Face> faces;
  for (std::size_t i = 0; i < corners.size(); i += 3)
    faces.push_back({corners[i], corners[i + 1], corners[i + 2]});
  return faces;
}

bool IsSeen(const ParameterBlock& block, std::span<const int> views) {
  return !IsOfOneView(block.what) || std::ranges::find(views, block.view) != views.end();
}

// What of a block is state, but the count of its steps: tensors of rank 1.
std::vector<nn::NamedTensor> TensorsOf(const FittedBlock& block) {
  const auto flat = [](const nn::Tensor& tensor) {
    return tensor.Reshaped({tensor.shape().elements()});
  };
  const auto moments = block.adam->moments(0);
  return {{block.name() + ".values", flat(block.value.value())},
          {block.name() + ".m", flat(moments[0])},
          {block.name() + ".v", flat(moments[1])}};
}

}  // namespace

Fitter::Fitter(FitScene scene, const FitterOptions& options, const Workers& workers)
    : scene_(std::move(scene)),
      options_(options),
      context_(workers),
      renderer_(workers),
      unknowns_(context_, scene_, options.parameters),
      faces_(FacesOf(scene_.faces)),
      topology_(BuildTopology(faces_, scene_.vertices())),
      start_(context_.From({1, static_cast<std::int64_t>(scene_.vertices()), 3},
                           std::span<const float>(scene_.positions))),
      start_area_(SurfaceArea(faces_, scene_.positions)),
      diffusion_(topology_, options.smoothing),
      color_diffusion_(topology_, options.color_smoothing.value_or(0)) {
  for (const ParameterBlock& block : unknowns_.blocks()) {
    const bool reference =
        block.what == Parameter::kExposure && block.view == options.exposure_reference;
    if (!options.parameters[block.what] || reference) continue;
    FittedBlock& fitted = blocks_.emplace_back(FittedBlock{block, options.rates[block.what]});
    nn::AdamOptions adam = kAdam;
    adam.map = MapOf(block.what);
    fitted.adam = std::make_unique<nn::Adam>(
        context_, std::vector<nn::NamedVar>{{block.name(), block.value}}, adam);
  }
}

Result<std::unique_ptr<Fitter>> Fitter::Make(FitScene scene, const FitterOptions& options,
                                             const Workers& workers) {
  for (const Parameter what : kParameters) {
    if (!options.parameters[what]) continue;
    const std::string why = WhyExcluded(scene, what);
    if (!why.empty()) return InvalidArgument("{} cannot be fitted: {}", NameOf(what), why);
  }
  return std::unique_ptr<Fitter>(new Fitter(std::move(scene), options, workers));
}

// What the steps of a parameter go through; nullptr for those that step number by number.
nn::StepMap* Fitter::MapOf(Parameter what) {
  if (what == Parameter::kPositions) return &diffusion_;
  const bool colors = what == Parameter::kColors && options_.color_smoothing.has_value();
  return colors ? &color_diffusion_ : nullptr;
}

nn::Var Fitter::Loss(const FitStep& step, FitValues* values) {
  FitRenderer::Job job = step.job;
  job.views = step.views;
  job.alpha = options_.loss.silhouette_weight > 0;
  RenderedImages drawn = unknowns_.Render(&renderer_, job);
  if (!drawn.colors.valid()) return drawn.colors;
  const nn::Var gains = unknowns_.Gains(step.views);
  if (gains.valid()) drawn.colors = drawn.colors * gains;
  LossSum sum(values);
  AddImageLosses(options_.loss, *step.targets,
                 {step.views, drawn.colors, drawn.alpha, images().face_ids}, &sum);
  values->image_loss = values->loss;
  if (!options_.parameters[Parameter::kPositions]) return sum.total();
  RegularizerWeights weights = options_.regularizers;
  weights.area *= step.area_factor;
  const nn::Var& positions = unknowns_.blocks()[0].value;  // of the first of kParameters
  const nn::Var movement = positions - nn::Constant(context_, start_);
  const double unit_area = start_area_ > 0 ? start_area_ : 1;
  AddRegularizers(weights, {faces_, topology_, positions, movement, unit_area}, &sum);
  return sum.total();
}

Status Fitter::CheckFinite(const FitValues& values) const {
  if (!std::isfinite(values.loss)) return InternalError("the loss is not finite");
  for (const FittedBlock& block : blocks_) {
    if (!AllFinite(block.gradient.value().span<float>()))
      return InternalError("the gradient of {} is not finite", block.name());
  }
  return {};
}

Result<FitValues> Fitter::Evaluate(const FitStep& step) {
  FitValues values;
  const nn::Var loss = Loss(step, &values);
  TILEGRAD_TRY(context_.TakeStatus());
  std::vector<nn::Var> leaves;
  for (const FittedBlock& block : blocks_) leaves.push_back(block.value);
  const auto gradients = nn::Grad(loss, leaves);
  TILEGRAD_TRY(context_.TakeStatus());
  for (std::size_t i = 0; i < blocks_.size(); ++i) blocks_[i].gradient = gradients[i];
  return values;
}

Status Fitter::Move(FittedBlock* block, const FitStep& step) {
  const double of_kind = FactorOf(step, block->what);
  if (of_kind == 0) return {};
  block->adam->options().learning_rate = step.rate_factor * of_kind * block->learning_rate;
  TILEGRAD_TRY(block->adam->Step(std::span<const nn::Var>(&block->gradient, 1)));
  return unknowns_.Write(*block, &scene_);
}

Result<FitValues> Fitter::Step(const FitStep& step) {
  TILEGRAD_ASSIGN(FitValues values, Evaluate(step));
  TILEGRAD_TRY(CheckFinite(values));
  for (FittedBlock& block : blocks_) {
    if (IsSeen(block, step.views)) TILEGRAD_TRY(Move(&block, step));
  }
  return values;
}

std::vector<nn::NamedTensor> Fitter::State() const {
  std::vector<nn::NamedTensor> state = {{kFaces, context_.Indices(scene_.faces)}};
  for (const FittedBlock& block : blocks_) {
    for (nn::NamedTensor& tensor : TensorsOf(block)) state.push_back(std::move(tensor));
    nn::Tensor steps = context_.Empty({1}, nn::DType::kI64);
    *steps.data<std::int64_t>() = block.adam->steps();
    state.push_back({block.name() + ".steps", steps});
  }
  return state;
}

Status Fitter::LoadState(const std::vector<nn::NamedTensor>& state) {
  std::vector<nn::NamedTensor> own = State();
  const nn::Tensor faces = own[0].value;
  const nn::Tensor here = context_.Copy(faces);
  TILEGRAD_TRY(nn::CopyByName(state, own));
  if (!std::ranges::equal(faces.span<std::int32_t>(), here.span<std::int32_t>()))
    return DataLoss("\"{}\": the fit was started with another mesh", kFaces);
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const std::int64_t steps = *own[4 * (i + 1)].value.data<std::int64_t>();
    if (steps < 0) return DataLoss("\"{}.steps\" is {}", blocks_[i].name(), steps);
    blocks_[i].adam->set_steps(steps);
    TILEGRAD_TRY(unknowns_.Write(blocks_[i], &scene_));
  }
  return {};
}

}  // namespace tilegrad::train
