// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/single_image/oracle.h"

#include <cmath>
#include <memory>

#include "base/error.h"
#include "nn/nn.h"
#include "nn/optim.h"
#include "train/tasks/single_image/step.h"

namespace tilegrad::train {
namespace {

// Rates: of the numbers that deform the template (world units) and of colours; they fall to a
// twentieth.
constexpr int kViewsAtOnce = 8;
constexpr double kShapeRate = 0.01, kColorRate = 0.03, kFinalFactor = 0.05;

// The views of one object as the images of a store.
ImageStore StoreOf(const ModelData& data, const DatasetInfo& info) {
  ImageStore store;
  store.bytes.Assign(data.images);
  store.models = 1;
  store.views = info.views;
  store.size = info.image_size;
  store.cameras = CamerasOf(info, data.cameras);
  return store;
}

// Views step, step + n, ... of n evenly spread ones: all around each time, all views in turn.
std::vector<int> ViewsAt(int step, int views) {
  const int count = std::min(views, kViewsAtOnce);
  std::vector<int> out;
  for (int i = 0; i < count; ++i) out.push_back((step + i * views / count) % views);
  return out;
}

struct Unknowns {
  nn::Var raw, colors;
};

class TemplateFitter {
 public:
  TemplateFitter(const SingleImageConfig& config, const DatasetInfo& info, const Workers& workers)
      : config_(config),
        info_(info),
        context_(workers),
        shape_(context_, config.network.sphere),
        losses_(context_, config, shape_, info.image_size) {}

  Result<Mesh> Fit(const ModelData& data) {
    const ImageStore store = StoreOf(data, info_);
    const Unknowns x = {nn::Parameter(context_, context_.Zeros({1, shape_.numbers()})),
                        nn::Parameter(context_, context_.Full({1, shape_.vertices(), 3}, 0.5))};
    nn::Adam shape_adam(context_, {{"shape", x.raw}}, {}),
        color_adam(context_, {{"color", x.colors}}, {});
    nn::Adam* const optimizers[] = {&shape_adam, &color_adam};
    for (int step = 0; step < config_.schedule.steps; ++step)
      TILEGRAD_TRY(Step(store, x, step, optimizers));
    const nn::NoGrad off(context_);
    const Prediction meshes = MeshesOf(x);
    TILEGRAD_TRY(context_.TakeStatus());
    return MeshOf(shape_, meshes, 0);
  }

 private:
  Prediction MeshesOf(const Unknowns& x) const {
    Prediction meshes;
    meshes.movement = shape_.Movement(x.raw);
    meshes.positions = shape_.Normalized(meshes.movement);
    meshes.colors = x.colors;
    return meshes;
  }

  Status Step(const ImageStore& store, const Unknowns& x, int step,
              std::span<nn::Adam* const> optimizers) {
    const BatchTensors batch = GatherBatch(context_, store, {{0, ViewsAt(step, store.views)}});
    StepValues values;
    const nn::Var loss = losses_.Total(MeshesOf(x), batch, step, &values);
    const nn::Var unknowns[] = {x.raw, x.colors};
    const auto gradients = nn::Gradients(loss, unknowns);
    TILEGRAD_TRY(context_.TakeStatus());
    if (!std::isfinite(values.loss) || !nn::IsFinite(context_, gradients))
      return InternalError("fitting the template: the loss is {}", values.loss);
    const nn::CosineSchedule cosine{config_.schedule.steps, kFinalFactor};
    for (std::size_t i = 0; i < optimizers.size(); ++i) {
      optimizers[i]->options().learning_rate =
          nn::CosineRate(i == 0 ? kShapeRate : kColorRate, cosine, step);
      TILEGRAD_TRY(optimizers[i]->Step(std::span<const nn::Gradient>(gradients).subspan(i, 1)));
    }
    return {};
  }

  SingleImageConfig config_;
  DatasetInfo info_;
  nn::Context context_;
  SphereModel shape_;
  ImageLosses losses_;
};

}  // namespace

FitFunction FitTemplates(const SingleImageConfig& config, const DatasetInfo& info, int steps,
                         const Workers& workers) {
  SingleImageConfig ours = config;
  ours.render.rule = "dibr";
  ours.schedule.steps = steps;
  ours.network.sphere.half_extent = info.camera.half_extent;
  const auto fitter = std::make_shared<TemplateFitter>(ours, info, workers);
  return [fitter](const ModelData& data) { return fitter->Fit(data); };
}

}  // namespace tilegrad::train
