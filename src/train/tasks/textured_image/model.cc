// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/textured_image/model.h"

#include <algorithm>

#include "base/error.h"
#include "nn/nn.h"
#include "train/tasks/learned_weights.h"
#include "train/tasks/textured_image/step.h"

namespace tilegrad::train {
namespace {

class LoadedModel : public TexturedModel {
 public:
  LoadedModel(nn::Context& context, const TexturedImageConfig& config, int image_size)
      : context_(context),
        config_(config),
        image_size_(image_size),
        network_(context, NetworkOf(config), LightHeadOf(config.light), image_size, /*seed=*/0),
        template_(network_.sphere().mesh()) {}

  Status Load(const std::vector<nn::NamedTensor>& state) {
    TILEGRAD_TRY(context_.TakeStatus());
    TILEGRAD_TRY(LoadPredictingWeights(network_.module(), state));
    parameters_ = nn::CountParameters(network_.module());
    return NormalizeToBox(template_, kPredictionHalfExtent);
  }

  std::int64_t parameters() const override { return parameters_; }
  const Mesh& template_mesh() const override { return template_; }
  Status Predict(std::span<const std::uint8_t> images, std::vector<Mesh>* meshes) override;
  Result<std::vector<PredictedObject>> PredictObjects(
      std::span<const std::uint8_t> images) override {
    return train::PredictObjects(context_, network_, images, image_size_);
  }

  const TexturedImageConfig& config() const override { return config_; }

 private:
  nn::Context& context_;
  TexturedImageConfig config_;
  int image_size_;
  TextureNetwork network_;
  Mesh template_;
  std::int64_t parameters_ = 0;
};

Status LoadedModel::Predict(std::span<const std::uint8_t> images, std::vector<Mesh>* meshes) {
  TILEGRAD_ASSIGN(std::vector<PredictedObject> objects, PredictObjects(images));
  for (PredictedObject& object : objects) meshes->push_back(std::move(object.mesh));
  return {};
}

}  // namespace

Result<std::vector<PredictedObject>> PredictObjects(nn::Context& context, TextureNetwork& network,
                                                    std::span<const std::uint8_t> images,
                                                    int image_size) {
  const nn::NoGrad off(context);
  const std::size_t bytes = 4 * static_cast<std::size_t>(image_size * image_size);
  const std::size_t count = images.size() / bytes;
  nn::Tensor input = context.Empty({static_cast<std::int64_t>(count), 4, image_size, image_size});
  std::ranges::transform(images, input.data<float>(),
                         [](std::uint8_t b) { return static_cast<float>(b) / 255; });
  const Prediction predicted =
      network.Forward(nn::Constant(context, std::move(input)), nn::Mode::kEval);
  TILEGRAD_TRY(context.TakeStatus());
  std::vector<PredictedObject> objects;
  for (std::size_t i = 0; i < count; ++i) {
    TILEGRAD_ASSIGN(Mesh mesh, MeshOf(network.sphere(), predicted, i));
    objects.push_back({std::move(mesh), LightOf(predicted, i), {}});
    if (!predicted.pose.valid()) continue;
    Pose pose;
    std::ranges::copy(ItemOf(predicted.pose, i), pose.begin());
    objects.back().camera = CameraOf(pose, image_size);
  }
  return objects;
}

Status TexturedModel::CheckRefinable() const {
  return InvalidArgument("predictions of texture and light are not refined: use --refine 0");
}

Result<std::unique_ptr<Model>> LoadTexturedModel(nn::Context& context,
                                                 const TexturedImageConfig& config,
                                                 const Checkpoint& checkpoint) {
  TILEGRAD_TRY(CheckConfig(config));
  const std::int64_t size = checkpoint.info.image_size;
  TILEGRAD_TRY(CheckImageSize(config.network, static_cast<int>(size)));
  auto model = std::make_unique<LoadedModel>(context, config, static_cast<int>(size));
  TILEGRAD_TRY(model->Load(checkpoint.tensors));
  return std::unique_ptr<Model>(std::move(model));
}

}  // namespace tilegrad::train
