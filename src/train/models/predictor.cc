// SPDX-License-Identifier: Apache-2.0
#include "train/models/predictor.h"

#include <algorithm>

#include "base/error.h"
#include "nn/nn.h"
#include "train/config.h"
#include "train/models/mesh_network.h"
#include "train/run/checkpoint.h"

namespace tilegrad::train {
namespace {

constexpr std::size_t kBatch = 32;  // images at a time: bounds the memory of activations

Result<Checkpoint> FindCheckpoint(nn::Context& context, const Path& path,
                                  std::vector<std::string>* warnings) {
  std::error_code error;
  if (!std::filesystem::is_directory(path, error)) return LoadCheckpoint(context, path);
  TILEGRAD_ASSIGN(FoundCheckpoint found, LoadNewestCheckpoint(context, path));
  *warnings = std::move(found.warnings);
  return std::move(found.checkpoint);
}

}  // namespace

struct Predictor::Impl {
  explicit Impl(const Workers& workers) : context(workers) {}
  nn::Context context;
  CheckpointInfo info;
  TrainConfig config;
  std::vector<std::string> warnings;
  std::unique_ptr<MeshNetwork> network;
  Mesh template_mesh;

  std::size_t ImageBytes() const {
    return static_cast<std::size_t>(4 * info.image_size * info.image_size);
  }
  Status PredictSome(std::span<const std::uint8_t> images, std::vector<Mesh>* out);
};

Predictor::Predictor() = default;
Predictor::~Predictor() = default;
Predictor::Predictor(Predictor&&) noexcept = default;
Predictor& Predictor::operator=(Predictor&&) noexcept = default;

Result<Predictor> Predictor::Load(const Path& path, const Workers& workers) {
  Predictor out;
  out.impl_ = std::make_unique<Impl>(workers);
  Impl& impl = *out.impl_;
  TILEGRAD_ASSIGN(const Checkpoint checkpoint, FindCheckpoint(impl.context, path, &impl.warnings));
  impl.info = checkpoint.info;
  TILEGRAD_ASSIGN(impl.config,
                  ParseConfig(impl.info.config, path.string() + ": its configuration"));
  if (impl.info.image_size < 8 || impl.info.image_size > 4096 || impl.info.image_size % 8 != 0) {
    return DataLoss("{}: image size {} is not possible", path.string(), impl.info.image_size);
  }
  impl.network = std::make_unique<MeshNetwork>(impl.context, impl.config.network,
                                               static_cast<int>(impl.info.image_size), 0);
  TILEGRAD_TRY(impl.context.TakeStatus());
  TILEGRAD_TRY(nn::LoadState(impl.network->module(), checkpoint.tensors).Within(path.string()));
  impl.template_mesh = impl.network->template_mesh();
  TILEGRAD_TRY(NormalizeToBox(impl.template_mesh, kPredictionHalfExtent));
  return out;
}

const std::vector<std::string>& Predictor::warnings() const { return impl_->warnings; }

int Predictor::image_size() const { return static_cast<int>(impl_->info.image_size); }

Status Predictor::CheckImageSize(const Dataset& dataset) const {
  if (dataset.info().image_size == image_size()) return {};
  return InvalidArgument("{}: images are {} pixels a side, the network was trained on {}",
                         dataset.folder().string(), dataset.info().image_size, image_size());
}

std::string Predictor::description() const {
  return fmt::format("{} network, {} parameters, step {}", impl_->config.name,
                     nn::CountParameters(impl_->network->module()), impl_->info.step);
}

const Mesh& Predictor::template_mesh() const { return impl_->template_mesh; }

Status Predictor::Impl::PredictSome(std::span<const std::uint8_t> images, std::vector<Mesh>* out) {
  const nn::NoGrad off(context);
  const auto count = static_cast<std::int64_t>(images.size() / ImageBytes());
  nn::Tensor input = context.Empty({count, 4, info.image_size, info.image_size});
  std::transform(images.begin(), images.end(), input.data<float>(),
                 [](std::uint8_t b) { return static_cast<float>(b) / 255; });
  const PredictedMeshes meshes =
      network->Forward(nn::Constant(context, std::move(input)), nn::Mode::kEval);
  TILEGRAD_TRY(context.TakeStatus());
  const std::size_t vertices = template_mesh.positions.size();
  const float* p = meshes.positions.value().data<float>();
  const float* c = meshes.colors.value().data<float>();
  for (std::int64_t i = 0; i < count; ++i) {
    Mesh mesh;
    mesh.faces = template_mesh.faces;
    for (std::size_t v = 0; v < vertices; ++v, p += 3, c += 3) {
      mesh.positions.emplace_back(p[0], p[1], p[2]);
      const auto unit = [](float x) { return std::clamp(x, 0.0f, 1.0f); };
      mesh.colors.emplace_back(unit(c[0]), unit(c[1]), unit(c[2]), 1.0f);
    }
    if (const Status valid = Validate(mesh); !valid.ok())
      return InternalError("the prediction is broken: {}", valid.message());
    out->push_back(std::move(mesh));
  }
  return {};
}

Result<std::vector<Mesh>> Predictor::Predict(std::span<const std::uint8_t> images) const {
  const std::size_t bytes = impl_->ImageBytes();
  if (images.size() % bytes != 0) {
    return InvalidArgument("images must be [N][4][{0}][{0}] bytes, got {1}", image_size(),
                           images.size());
  }
  std::vector<Mesh> out;
  for (std::size_t at = 0; at < images.size(); at += kBatch * bytes) {
    TILEGRAD_TRY(
        impl_->PredictSome(images.subspan(at, std::min(kBatch * bytes, images.size() - at)), &out));
  }
  return out;
}

}  // namespace tilegrad::train
