// SPDX-License-Identifier: Apache-2.0
#include "train/predictor.h"

#include <algorithm>

#include "base/error.h"
#include "scene/shapes.h"
#include "scene/unlit.h"
#include "train/config.h"
#include "train/run/checkpoint.h"
#include "train/run/run_files.h"

namespace tilegrad::train {
struct Predictor::Impl {
  explicit Impl(const Workers& workers) : context(workers) {}
  nn::Context context;
  CheckpointInfo info;
  Path checkpoint;
  TrainConfig config;
  std::vector<std::string> warnings;
  std::unique_ptr<Model> model;
};

Predictor::Predictor() = default;
Predictor::~Predictor() = default;
Predictor::Predictor(Predictor&&) noexcept = default;
Predictor& Predictor::operator=(Predictor&&) noexcept = default;

Result<Predictor> Predictor::Load(const Path& path, const Workers& workers) {
  Predictor out;
  out.impl_ = std::make_unique<Impl>(workers);
  Impl& impl = *out.impl_;
  TILEGRAD_ASSIGN(FoundCheckpoint found, FindCheckpoint(impl.context, path));
  impl.warnings = std::move(found.warnings);
  impl.info = found.checkpoint.info;
  impl.checkpoint = found.file;
  if (impl.info.image_size < 1 || impl.info.image_size > 4096)
    return DataLoss("{}: image size {} is not possible", path.string(), impl.info.image_size);
  if (IsOfFit(impl.info.config)) {
    return InvalidArgument("{}: is a fit, which predicts nothing; name a run of tilegrad train",
                           path.string());
  }
  TILEGRAD_ASSIGN(impl.config,
                  ParseConfig(impl.info.config, path.string() + ": its configuration"));
  auto model = impl.config.task->LoadModel(impl.context, found.checkpoint);
  if (!model.ok()) return model.status().Within(path.string());
  impl.model = std::move(model).value();
  return out;
}

const std::vector<std::string>& Predictor::warnings() const { return impl_->warnings; }

const Path& Predictor::checkpoint() const { return impl_->checkpoint; }

int Predictor::image_size() const { return static_cast<int>(impl_->info.image_size); }

std::int64_t Predictor::step() const { return impl_->info.step; }

Status Predictor::CheckImageSize(const Dataset& dataset) const {
  if (dataset.info().image_size == image_size()) return {};
  return InvalidArgument("{}: images are {} pixels a side, the network was trained on {}",
                         dataset.folder().string(), dataset.info().image_size, image_size());
}

std::string Predictor::description() const {
  return fmt::format("{} network, {} parameters, step {}", impl_->config.name,
                     impl_->model->parameters(), impl_->info.step);
}

const Mesh& Predictor::template_mesh() const { return impl_->model->template_mesh(); }

Task& Predictor::task() const { return *impl_->config.task; }

Model& Predictor::model() const { return *impl_->model; }

Result<std::vector<Mesh>> Predictor::Predict(std::span<const std::uint8_t> images) const {
  const std::size_t bytes = 4 * static_cast<std::size_t>(image_size() * image_size());
  if (images.size() % bytes != 0) {
    return InvalidArgument("images must be [N][4][{0}][{0}] bytes, got {1}", image_size(),
                           images.size());
  }
  std::vector<Mesh> out;
  for (std::size_t at = 0; at < images.size(); at += Model::kImagesAtOnce * bytes) {
    const std::size_t size = std::min(Model::kImagesAtOnce * bytes, images.size() - at);
    TILEGRAD_TRY(impl_->model->Predict(images.subspan(at, size), &out));
  }
  for (Mesh& mesh : out) {
    if (mesh.normals.empty()) mesh.normals = SmoothNormals(mesh);
    SetUnlit(mesh, "predicted");
  }
  return out;
}

}  // namespace tilegrad::train
