// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/single_image/model.h"

#include <algorithm>

#include "base/error.h"
#include "nn/nn.h"
#include "train/tasks/learned_weights.h"

namespace tilegrad::train {
namespace {

class SingleImageModel : public Model {
 public:
  SingleImageModel(nn::Context& context, const NetworkConfig& config, int image_size)
      : context_(context),
        image_size_(image_size),
        network_(context, config, image_size, /*seed=*/0),
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

 private:
  nn::Context& context_;
  int image_size_;
  MeshNetwork network_;
  Mesh template_;
  std::int64_t parameters_ = 0;
};

Status SingleImageModel::Predict(std::span<const std::uint8_t> images, std::vector<Mesh>* meshes) {
  const nn::NoGrad off(context_);
  const std::size_t bytes = 4 * static_cast<std::size_t>(image_size_ * image_size_);
  const std::size_t count = images.size() / bytes;
  nn::Tensor input =
      context_.Empty({static_cast<std::int64_t>(count), 4, image_size_, image_size_});
  std::transform(images.begin(), images.end(), input.data<float>(),
                 [](std::uint8_t b) { return static_cast<float>(b) / 255; });
  const Prediction predicted =
      network_.Forward(nn::Constant(context_, std::move(input)), nn::Mode::kEval);
  TILEGRAD_TRY(context_.TakeStatus());
  for (std::size_t i = 0; i < count; ++i) {
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
  auto model = std::make_unique<SingleImageModel>(context, config, static_cast<int>(size));
  TILEGRAD_TRY(model->Load(checkpoint.tensors));
  return std::unique_ptr<Model>(std::move(model));
}

}  // namespace tilegrad::train
