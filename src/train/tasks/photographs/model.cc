// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/photographs/model.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "nn/nn.h"

namespace tilegrad::train {
namespace {

// A planar RGBA picture over black, cropped to its object as training crops photographs.
class CutoutCrop {
 public:
  CutoutCrop(std::span<const std::uint8_t> image, int size, const CropRule& rule)
      : image_(image), size_(size) {
    PhotoBox box{1e9, 1e9, -1e9, -1e9};
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        if (At(3, x, y) < 128) continue;
        box = {std::min(box.left, x + 0.0), std::min(box.top, y + 0.0),
               std::max(box.right, x + 1.0), std::max(box.bottom, y + 1.0)};
      }
    }
    window_ = box.right > box.left ? WindowOf(box, rule, nullptr)
                                   : PhotoWindow{0, 0, static_cast<double>(size)};
  }

  // Bilinear; black beyond the edges.
  void Write(float* out) const {
    const double step = window_.side / size_;
    for (int c = 0; c < 3; ++c) {
      for (int y = 0; y < size_; ++y) {
        for (int x = 0; x < size_; ++x)
          *out++ = Between(c, window_.left + (x + 0.5) * step - 0.5,
                           window_.top + (y + 0.5) * step - 0.5);
      }
    }
  }

 private:
  int At(int c, int x, int y) const {
    if (x < 0 || y < 0 || x >= size_ || y >= size_) return 0;
    return image_[static_cast<std::size_t>((c * size_ + y) * size_ + x)];
  }
  float Between(int c, double x, double y) const {
    const int u = static_cast<int>(std::floor(x)), v = static_cast<int>(std::floor(y));
    const double fx = x - u, fy = y - v;
    const double upper = (1 - fx) * At(c, u, v) + fx * At(c, u + 1, v);
    const double lower = (1 - fx) * At(c, u, v + 1) + fx * At(c, u + 1, v + 1);
    return static_cast<float>(((1 - fy) * upper + fy * lower) / 255);
  }

  std::span<const std::uint8_t> image_;
  int size_;
  PhotoWindow window_;
};

// As many keypoints as the checkpoint has.
std::size_t KeypointsIn(const Checkpoint& checkpoint) {
  const nn::Tensor* keypoints = nn::Find(checkpoint.tensors, "keypoints");
  return keypoints == nullptr ? 0 : static_cast<std::size_t>(keypoints->shape()[0]);
}

}  // namespace

PhotographModel::PhotographModel(nn::Context& context, const PhotographsConfig& config,
                                 const Checkpoint& checkpoint)
    : context_(context),
      config_(config),
      network_(context, config.network, {.count = KeypointsIn(checkpoint)},
               static_cast<int>(config.size), /*seed=*/0) {}

Status PhotographModel::Load(const std::vector<nn::NamedTensor>& state) {
  TILEGRAD_TRY(context_.TakeStatus());
  TILEGRAD_TRY(LoadWeights(network_.module(), state));
  const nn::NoGrad off(context_);
  const nn::Var mean = network_.MeanShape();
  TILEGRAD_TRY(context_.TakeStatus());
  TILEGRAD_ASSIGN(const Mesh shape, MeshOf(network_.sphere(), {.positions = mean}, 0));
  return SetTemplate(shape, kPredictionHalfExtent);
}

Status PhotographModel::Predict(std::span<const std::uint8_t> images, std::vector<Mesh>* meshes) {
  const auto size = static_cast<std::size_t>(config_.size);
  const std::size_t bytes = 4 * size * size, count = images.size() / bytes;
  nn::Tensor pictures =
      context_.Empty({static_cast<std::int64_t>(count), 3, config_.size, config_.size});
  for (std::size_t i = 0; i < count; ++i)
    CutoutCrop(images.subspan(i * bytes, bytes), static_cast<int>(size), config_.crop)
        .Write(pictures.data<float>() + 3 * size * size * i);
  TILEGRAD_ASSIGN(auto predicted, PredictPhotographs(context_, network_, pictures));
  for (PredictedPhotograph& photo : predicted) {
    TILEGRAD_TRY(NormalizeToBox(photo.mesh, kPredictionHalfExtent));
    meshes->push_back(std::move(photo.mesh));
  }
  return {};
}

Result<std::vector<PredictedPhotograph>> PredictPhotographs(nn::Context& context,
                                                            PhotographNetwork& network,
                                                            const nn::Tensor& pictures) {
  const nn::NoGrad off(context);
  const Prediction all = network.Forward(nn::Constant(context, pictures), nn::Mode::kEval);
  TILEGRAD_TRY(context.TakeStatus());
  const auto count = static_cast<std::size_t>(pictures.shape()[0]);
  std::vector<PredictedPhotograph> out(count);
  for (std::size_t i = 0; i < count; ++i) {
    TILEGRAD_ASSIGN(out[i].mesh, MeshOf(network.sphere(), all, i));
    const auto c = ItemOf(all.cameras, i);
    out[i].camera = {c[0], {c[1], c[2]}, {c[3], c[4], c[5], c[6]}};
    if (!all.keypoints.valid()) continue;
    const auto k = ItemOf(all.keypoints, i);
    for (std::size_t at = 0; at < k.size(); at += 3)
      out[i].keypoints.push_back({k[at], k[at + 1], k[at + 2]});
  }
  return out;
}

Result<std::unique_ptr<Model>> LoadPhotographModel(nn::Context& context,
                                                   const PhotographsConfig& config,
                                                   const Checkpoint& checkpoint) {
  TILEGRAD_TRY(CheckConfig(config));
  if (checkpoint.info.image_size != config.size)
    return DataLoss("photographs of {} pixels a side, but its configuration says {}",
                    checkpoint.info.image_size, config.size);
  auto model = std::make_unique<PhotographModel>(context, config, checkpoint);
  TILEGRAD_TRY(model->Load(checkpoint.tensors));
  return std::unique_ptr<Model>(std::move(model));
}

}  // namespace tilegrad::train
