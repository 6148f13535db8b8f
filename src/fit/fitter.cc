// SPDX-License-Identifier: Apache-2.0
#include "fit/fitter.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "base/array_checks.h"
#include "base/error.h"
#include "nn/context.h"
#include "nn/kernels/adam.h"

namespace tilegrad::train {
namespace {

constexpr double kBeta1 = 0.9, kBeta2 = 0.999;

// The arrays of a block that are state.
template <class Block>
auto StateArrays(Block& block) {
  return std::array{std::pair{"values", &block.values}, std::pair{"m", &block.m},
                    std::pair{"v", &block.v}};
}

// Names of the mesh's tensors in a state.
constexpr const char *kFaces = "mesh.faces", *kUvs = "mesh.uvs", *kUvIndices = "mesh.uv_indices",
                     *kStart = "mesh.start", *kColors = "mesh.colors";

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

nn::Tensor Numbers(nn::Context& context, std::span<const float> values) {
  nn::Tensor tensor = context.Empty({static_cast<std::int64_t>(values.size())}, nn::DType::kF32);
  std::copy(values.begin(), values.end(), tensor.data<float>());
  return tensor;
}

const nn::Tensor* FindTensor(std::span<const nn::NamedTensor> state, const std::string& name) {
  const auto at = std::find_if(state.begin(), state.end(),
                               [&](const nn::NamedTensor& t) { return t.name == name; });
  return at == state.end() ? nullptr : &at->value;
}

template <class T>
Status Take(std::span<const nn::NamedTensor> state, const char* name, std::vector<T>* to) {
  const nn::Tensor* tensor = FindTensor(state, name);
  const nn::DType type = std::is_same_v<T, float> ? nn::DType::kF32 : nn::DType::kI32;
  if (tensor == nullptr || tensor->dtype() != type)
    return DataLoss("\"{}\" is missing or of another type", name);
  to->resize(tensor->elements());
  std::copy_n(tensor->data<T>(), to->size(), to->begin());
  return {};
}

bool AllBelow(std::span<const std::int32_t> indices, std::size_t count) {
  return std::all_of(indices.begin(), indices.end(), [count](std::int32_t i) {
    return i >= 0 && static_cast<std::size_t>(i) < count;
  });
}

// What a checkpoint has, beside the start: indices within their arrays, and the same kinds of
// arrays.
Status CheckMesh(const FitScene& scene, const FitScene& start) {
  const bool good = scene.faces.size() % 3 == 0 && scene.positions.size() % 3 == 0 &&
                    scene.uvs.size() % 2 == 0 && AllBelow(scene.faces, scene.vertices()) &&
                    AllBelow(scene.uv_indices, scene.uvs.size() / 2) &&
                    (scene.uv_indices.empty() || scene.uv_indices.size() == scene.faces.size()) &&
                    scene.uv_indices.empty() == start.uv_indices.empty() &&
                    (scene.colors.empty() ? start.colors.empty()
                                          : scene.colors.size() == scene.positions.size()) &&
                    AllFinite(scene.positions) && AllFinite(scene.uvs);
  return good ? Status() : DataLoss("the \"mesh.\" arrays do not match");
}

}  // namespace

Fitter::Fitter(FitScene scene, const FitterOptions& options, const Workers& workers)
    : scene_(std::move(scene)),
      options_(options),
      workers_(&workers),
      renderer_(std::make_unique<FitRenderer>(workers)),
      regularizer_(scene_.faces, scene_.positions),
      diffusion_(regularizer_.topology(), options.smoothing),
      color_diffusion_(regularizer_.topology(), options.color_smoothing.value_or(0)) {
  for (const Parameter what : kParameters) {
    if (!options.parameters[what]) continue;
    const double rate = options.rates[what];
    if (!IsOfOneView(what)) {
      blocks_.push_back(MakeBlock(scene_, what, rate));
      continue;
    }
    for (int i = 0; i < static_cast<int>(scene_.cameras.size()); ++i) {
      if (what == Parameter::kExposure && i == options.exposure_reference) continue;
      blocks_.push_back(MakeBlock(scene_, what, rate, i));
    }
  }
}

Result<Fitter> Fitter::Make(FitScene scene, const FitterOptions& options, const Workers& workers) {
  for (const Parameter what : kParameters) {
    if (!options.parameters[what]) continue;
    const std::string why = WhyExcluded(scene, what);
    if (!why.empty()) return InvalidArgument("{} cannot be fitted: {}", NameOf(what), why);
  }
  return Fitter(std::move(scene), options, workers);
}

// Blocks whose parameter some of the views sees, with the entry of a block's view among them.
template <class Visit>
void Fitter::ForEachOfViews(std::span<const int> views, const Visit& visit) {
  for (ParameterBlock& block : blocks_) {
    const auto at = std::find(views.begin(), views.end(), block.view);
    if (IsOfOneView(block.what) && at == views.end()) continue;
    visit(block, static_cast<std::size_t>(at - views.begin()));
  }
}

Status Fitter::CheckFinite(const FitValues& values) const {
  if (!std::isfinite(values.total)) return InternalError("the loss is not finite");
  for (const ParameterBlock& block : blocks_) {
    if (!AllFinite(block.gradient)) {
      return InternalError("the gradient of {} is not finite", block.name());
    }
  }
  return {};
}

Result<FitValues> Fitter::Evaluate(const FitStep& step) {
  FitRenderer::Job job = step.job;
  job.views = step.views;
  job.alpha = options_.loss.silhouette_weight > 0;
  TILEGRAD_TRY(renderer_->Render(scene_, job));
  FitValues values;
  values.image =
      rule_.Evaluate(options_.loss, *step.targets, {step.views, scene_.gains}, images(), *workers_);
  FrameGradients d_frame;
  d_frame.color = rule_.d_color();
  d_frame.alpha = rule_.d_alpha();
  TILEGRAD_TRY(renderer_->Backward(scene_, job, d_frame, options_.parameters, &gradients_));
  gradients_.gains.assign(rule_.d_gains().begin(), rule_.d_gains().end());
  RegularizerTerms w = options_.regularizers;
  w.area *= step.area_factor;
  if (options_.parameters[Parameter::kPositions]) {
    values.regularizers = regularizer_.Add(w, scene_.positions, gradients_.positions);
  }
  const RegularizerTerms& r = values.regularizers;
  values.total = values.image.total + w.laplacian * r.laplacian + w.flatness * r.flatness +
                 w.edge_length * r.edge_length + w.area * r.area;
  ForEachOfViews(step.views, [&](ParameterBlock& block, std::size_t rendered) {
    PullBlock(scene_, gradients_, rendered, &block);
  });
  return values;
}

// What the steps of a parameter go through; nullptr for those that step number by number.
Diffusion* Fitter::SmoothingOf(Parameter what) {
  if (what == Parameter::kPositions) return &diffusion_;
  const bool colors = what == Parameter::kColors && options_.color_smoothing.has_value();
  return colors ? &color_diffusion_ : nullptr;
}

Status Fitter::Move(ParameterBlock* block, const FitStep& step) {
  const double of_kind = FactorOf(step, block->what);
  if (of_kind == 0) return {};
  const double rate = step.rate_factor * of_kind * block->learning_rate;
  const auto t = static_cast<double>(++block->steps);
  if (Diffusion* const smooth = SmoothingOf(block->what); smooth != nullptr) {
    UniformAdamStep({rate, kBeta1, kBeta2, block->steps}, smooth, block->gradient, block->m,
                    block->v, block->values);
  } else {
    nn::AdamProblem<float> problem{block->values.size(),   block->values.data(),
                                   block->gradient.data(), block->m.data(),
                                   block->v.data(),        {}};
    // Losses are means over pixels: their gradients are small beside the usual epsilon.
    problem.coefficients = {.beta1 = kBeta1, .beta2 = kBeta2, .epsilon = 1e-12};
    problem.coefficients.step = rate / (1 - std::pow(kBeta1, t));
    problem.coefficients.inverse_root = 1 / std::sqrt(1 - std::pow(kBeta2, t));
    nn::AdamStep(problem, *workers_);
  }
  return WriteBlock(block, &scene_);
}

Result<FitValues> Fitter::Step(const FitStep& step) {
  TILEGRAD_ASSIGN(const FitValues values, Evaluate(step));
  TILEGRAD_TRY(CheckFinite(values));
  Status status;
  ForEachOfViews(step.views, [&](ParameterBlock& block, std::size_t) {
    if (status.ok()) status = Move(&block, step);
  });
  if (!status.ok()) return status;
  return values;
}

std::vector<nn::NamedTensor> Fitter::State(nn::Context& context) const {
  std::vector<nn::NamedTensor> state = {
      {kFaces, context.Indices(scene_.faces)},
      {kUvs, Numbers(context, scene_.uvs)},
      {kUvIndices, context.Indices(scene_.uv_indices)},
      {kStart, Numbers(context, regularizer_.start())},
      {kColors, Numbers(context, scene_.colors)},
  };
  for (const ParameterBlock& block : blocks_) {
    for (const auto& [part, array] : StateArrays(block)) {
      nn::Tensor tensor =
          context.Empty({static_cast<std::int64_t>(array->size())}, nn::DType::kF32);
      std::copy(array->begin(), array->end(), tensor.data<float>());
      state.push_back({block.name() + "." + part, tensor});
    }
    nn::Tensor steps = context.Empty({1}, nn::DType::kI64);
    *steps.data<std::int64_t>() = block.steps;
    state.push_back({block.name() + ".steps", steps});
  }
  return state;
}

// Checkpoints of earlier versions have no connectivity: theirs is the start's.
Status Fitter::LoadMesh(std::span<const nn::NamedTensor> state) {
  if (FindTensor(state, kFaces) == nullptr) return {};
  FitScene scene = scene_;
  TILEGRAD_TRY(Take(state, kFaces, &scene.faces));
  TILEGRAD_TRY(Take(state, kUvs, &scene.uvs));
  TILEGRAD_TRY(Take(state, kUvIndices, &scene.uv_indices));
  TILEGRAD_TRY(Take(state, kStart, &scene.positions));
  TILEGRAD_TRY(Take(state, kColors, &scene.colors));
  TILEGRAD_TRY(CheckMesh(scene, scene_));
  *this = Fitter(std::move(scene), options_, *workers_);
  return {};
}

Status Fitter::LoadState(std::span<const nn::NamedTensor> state) {
  TILEGRAD_TRY(LoadMesh(state));
  for (ParameterBlock& block : blocks_) {
    for (const auto& [part, array] : StateArrays(block)) {
      const std::string name = block.name() + "." + part;
      const nn::Tensor* tensor = FindTensor(state, name);
      if (tensor == nullptr || tensor->dtype() != nn::DType::kF32 ||
          tensor->elements() != array->size()) {
        return DataLoss("\"{}\" is missing or does not have {} numbers", name, array->size());
      }
      std::copy_n(tensor->data<float>(), array->size(), array->begin());
    }
    const nn::Tensor* steps = FindTensor(state, block.name() + ".steps");
    if (steps == nullptr || steps->dtype() != nn::DType::kI64 || steps->elements() != 1) {
      return DataLoss("\"{}.steps\" is missing", block.name());
    }
    block.steps = *steps->data<std::int64_t>();
    TILEGRAD_TRY(WriteBlock(&block, &scene_));
  }
  return {};
}

}  // namespace tilegrad::train
