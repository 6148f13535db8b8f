// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/textured_image/model.h"

#include <algorithm>

#include "base/error.h"
#include "nn/nn.h"
#include "train/tasks/textured_image/step.h"

namespace tilegrad::train {

TexturedModel::TexturedModel(nn::Context& context, const TexturedImageConfig& config,
                             int image_size)
    : context_(context),
      config_(config),
      image_size_(image_size),
      network_(context, NetworkOf(config), LightHeadOf(config.light), image_size, /*seed=*/0) {}

Status TexturedModel::Load(const std::vector<nn::NamedTensor>& state) {
  TILEGRAD_TRY(context_.TakeStatus());
  TILEGRAD_TRY(LoadWeights(network_.module(), state));
  return SetTemplate(network_.sphere().mesh(), config_.network.sphere.half_extent);
}

Status TexturedModel::Predict(std::span<const std::uint8_t> images, std::vector<Mesh>* meshes) {
  TILEGRAD_ASSIGN(std::vector<PredictedObject> objects, PredictObjects(images));
  for (PredictedObject& object : objects) meshes->push_back(std::move(object.mesh));
  return {};
}

Result<std::vector<PredictedObject>> TexturedModel::PredictObjects(
    std::span<const std::uint8_t> images) {
  return train::PredictObjects(context_, network_, images, image_size_);
}

Result<std::vector<PredictedObject>> PredictObjects(nn::Context& context, TextureNetwork& network,
                                                    std::span<const std::uint8_t> images,
                                                    int image_size) {
  const nn::NoGrad off(context);
  const nn::Tensor input = InputOf(context, images, image_size);
  const Prediction predicted = network.Forward(nn::Constant(context, input), nn::Mode::kEval);
  TILEGRAD_TRY(context.TakeStatus());
  std::vector<PredictedObject> objects;
  for (std::size_t i = 0; i < static_cast<std::size_t>(input.shape()[0]); ++i) {
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
  TILEGRAD_TRY(CheckImageSize(config.network.code, static_cast<int>(size)));
  TexturedImageConfig sized = config;
  sized.network.sphere.half_extent = checkpoint.info.half_extent;
  auto model = std::make_unique<TexturedModel>(context, sized, static_cast<int>(size));
  TILEGRAD_TRY(model->Load(checkpoint.tensors));
  return std::unique_ptr<Model>(std::move(model));
}

}  // namespace tilegrad::train
