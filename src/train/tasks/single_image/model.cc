// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/single_image/model.h"

#include <algorithm>

#include "base/error.h"
#include "nn/nn.h"
#include "render/picture/composite.h"
#include "train/models/render_op.h"

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

namespace {

constexpr int kSampleZoom = 2, kSampleGap = 2;

ImageU8 ShownPixels(const float* rgb, const float* alpha, int size) {
  const std::size_t plane = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  return Enlarged(OverGrey(PlanarRgba<float>{{rgb, 3 * plane}, {alpha, plane}, size, size}, kPaper),
                  kSampleZoom);
}

}  // namespace

Result<ImageU8> SampleSheet(nn::Context& context, TrainStep& step, const ImageStore& store,
                            std::span<const Sample> samples, std::int64_t at_step) {
  const nn::NoGrad off(context);
  const BatchTensors batch = GatherBatch(context, store, {samples.begin(), samples.end()});
  const Prediction meshes =
      step.network().Forward(nn::Constant(context, batch.input), nn::Mode::kEval);
  const int views = static_cast<int>(samples[0].views.size());
  const RenderedImages images = step.losses().DrawOurs(meshes, batch, at_step);
  TILEGRAD_TRY(context.TakeStatus());
  const std::size_t plane =
      static_cast<std::size_t>(store.size) * static_cast<std::size_t>(store.size);
  // Soft alpha is a signal for training, and rounds to 1 beside a face; people see what is covered.
  const std::span<const std::int32_t> ids = step.losses().renderer().frame.images().face_ids;
  std::vector<float> covered(ids.size());
  std::ranges::transform(ids, covered.begin(),
                         [](std::int32_t id) { return id < 0 ? 0.0f : 1.0f; });
  std::vector<ImageU8> cells;
  for (std::size_t n = 0; n < samples.size() * static_cast<std::size_t>(views); ++n) {
    cells.push_back(ShownPixels(batch.truth_colors.data<float>() + 3 * plane * n,
                                batch.truth_alpha.data<float>() + plane * n, store.size));
    cells.push_back(ShownPixels(images.colors.value().data<float>() + 3 * plane * n,
                                covered.data() + plane * n, store.size));
  }
  return TileImages(cells, 2 * views, kSampleGap);
}

}  // namespace tilegrad::train
