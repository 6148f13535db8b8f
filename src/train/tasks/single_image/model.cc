// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/single_image/model.h"

#include "base/error.h"
#include "nn/nn.h"

namespace tilegrad::train {
namespace {

class SingleImageModel : public Model {
 public:
  SingleImageModel(nn::Context& context, const NetworkConfig& config, int image_size)
      : context_(context),
        image_size_(image_size),
        network_(context, config, image_size, /*seed=*/0) {}

  Status Load(const std::vector<nn::NamedTensor>& state, double half_extent) {
    TILEGRAD_TRY(context_.TakeStatus());
    TILEGRAD_TRY(LoadWeights(network_.module(), state));
    return SetTemplate(network_.sphere().mesh(), half_extent);
  }
  Status Predict(std::span<const std::uint8_t> images, std::vector<Mesh>* meshes) override;

 private:
  nn::Context& context_;
  int image_size_;
  MeshNetwork network_;
};

Status SingleImageModel::Predict(std::span<const std::uint8_t> images, std::vector<Mesh>* meshes) {
  const nn::NoGrad off(context_);
  const nn::Tensor input = InputOf(context_, images, image_size_);
  const Prediction predicted = network_.Forward(nn::Constant(context_, input), nn::Mode::kEval);
  TILEGRAD_TRY(context_.TakeStatus());
  for (std::size_t i = 0; i < static_cast<std::size_t>(input.shape()[0]); ++i) {
    TILEGRAD_ASSIGN(Mesh mesh, MeshOf(network_.sphere(), predicted, i));
    meshes->push_back(std::move(mesh));
  }
  return {};
}

}  // namespace

Result<std::unique_ptr<Model>> LoadSingleImageModel(nn::Context& context,
                                                    const NetworkConfig& config,
                                                    const Checkpoint& checkpoint) {
  const std::int64_t size = checkpoint.info.image_size;
  if (size % 8 != 0) return DataLoss("image size {} is not possible", size);
  NetworkConfig sized = config;
  sized.sphere.half_extent = checkpoint.info.half_extent;
  auto model = std::make_unique<SingleImageModel>(context, sized, static_cast<int>(size));
  TILEGRAD_TRY(model->Load(checkpoint.tensors, checkpoint.info.half_extent));
  return std::unique_ptr<Model>(std::move(model));
}

}  // namespace tilegrad::train
