// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/single_image/model.h"

#include <algorithm>

#include "base/error.h"
#include "nn/nn.h"

namespace tilegrad::train {
namespace {

class SingleImageModel : public Model {
 public:
  SingleImageModel(nn::Context& context, const NetworkConfig& config, int image_size)
      : context_(context),
        image_size_(image_size),
        network_(context, config, image_size, /*seed=*/0),
        template_(network_.template_mesh()) {
    if (config.mirror_mean) mirror_ = MirrorVertices(template_);
  }

  // Of the moving average of the weights, where the run kept one.
  Status Load(const std::vector<nn::NamedTensor>& state) {
    TILEGRAD_TRY(context_.TakeStatus());
    const std::vector<nn::NamedTensor> averages = nn::Averages(state);
    TILEGRAD_TRY(nn::LoadState(network_.module(), averages.empty() ? state : averages));
    parameters_ = nn::CountParameters(network_.module());
    return NormalizeToBox(template_, kPredictionHalfExtent);
  }

  std::int64_t parameters() const override { return parameters_; }
  const Mesh& template_mesh() const override { return template_; }
  Status Predict(std::span<const std::uint8_t> images, std::vector<Mesh>* meshes) override;

 private:
  Status Forward(std::span<const std::uint8_t> images, bool mirrored, std::vector<Mesh>* meshes);
  nn::Tensor Input(std::span<const std::uint8_t> images, bool mirrored) const;
  Mesh MeshOf(const float* positions, const float* colors) const;
  // The mean of a mesh and of one that was predicted from the mirror image.
  Status AddMirrored(const Mesh& of_mirrored, Mesh* mesh) const;

  nn::Context& context_;
  int image_size_;
  MeshNetwork network_;
  Mesh template_;
  std::vector<std::int64_t> mirror_;  // of vertices; empty: predictions are of the picture alone
  std::int64_t parameters_ = 0;
};

Mesh SingleImageModel::MeshOf(const float* p, const float* c) const {
  const auto unit = [](float x) { return std::clamp(x, 0.0f, 1.0f); };
  Mesh mesh;
  mesh.faces = template_.faces;
  for (std::size_t v = 0; v < template_.positions.size(); ++v, p += 3, c += 3) {
    mesh.positions.emplace_back(p[0], p[1], p[2]);
    mesh.colors.emplace_back(unit(c[0]), unit(c[1]), unit(c[2]), 1.0f);
  }
  return mesh;
}

Status SingleImageModel::AddMirrored(const Mesh& of_mirrored, Mesh* mesh) const {
  for (std::size_t v = 0; v < mirror_.size(); ++v) {
    const auto from = static_cast<std::size_t>(mirror_[v]);
    const glm::vec3 p = of_mirrored.positions[from];
    mesh->positions[v] = 0.5f * (mesh->positions[v] + glm::vec3(-p.x, p.y, p.z));
    mesh->colors[v] = 0.5f * (mesh->colors[v] + of_mirrored.colors[from]);
  }
  return NormalizeToBox(*mesh, kPredictionHalfExtent);
}

nn::Tensor SingleImageModel::Input(std::span<const std::uint8_t> images, bool mirrored) const {
  const auto size = static_cast<std::size_t>(image_size_);
  const auto count = static_cast<std::int64_t>(images.size() / (4 * size * size));
  nn::Tensor input = context_.Empty({count, 4, image_size_, image_size_});
  float* to = input.data<float>();
  for (std::size_t row = 0; row < images.size(); row += size) {
    for (std::size_t x = 0; x < size; ++x)
      to[row + x] = static_cast<float>(images[row + (mirrored ? size - 1 - x : x)]) / 255;
  }
  return input;
}

Status SingleImageModel::Forward(std::span<const std::uint8_t> images, bool mirrored,
                                 std::vector<Mesh>* meshes) {
  const PredictedMeshes predicted =
      network_.Forward(nn::Constant(context_, Input(images, mirrored)), nn::Mode::kEval);
  TILEGRAD_TRY(context_.TakeStatus());
  const std::size_t numbers = 3 * template_.positions.size();  // of a mesh
  const auto count = static_cast<std::size_t>(predicted.positions.shape()[0]);
  for (std::size_t i = 0; i < count; ++i) {
    Mesh mesh = MeshOf(predicted.positions.value().data<float>() + i * numbers,
                       predicted.colors.value().data<float>() + i * numbers);
    if (const Status valid = Validate(mesh); !valid.ok())
      return InternalError("the prediction is broken: {}", valid.message());
    meshes->push_back(std::move(mesh));
  }
  return {};
}

Status SingleImageModel::Predict(std::span<const std::uint8_t> images, std::vector<Mesh>* meshes) {
  const nn::NoGrad off(context_);
  const std::size_t before = meshes->size();
  TILEGRAD_TRY(Forward(images, false, meshes));
  if (mirror_.empty()) return {};
  std::vector<Mesh> mirrored;
  TILEGRAD_TRY(Forward(images, true, &mirrored));
  for (std::size_t i = 0; i < mirrored.size(); ++i)
    TILEGRAD_TRY(AddMirrored(mirrored[i], &(*meshes)[before + i]));
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
