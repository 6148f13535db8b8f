// SPDX-License-Identifier: Apache-2.0
#include "train/predictor.h"

#include <algorithm>

#include "base/error.h"
#include "scene/shapes.h"
#include "train/run/carried_files.h"
#include "train/run/run_files.h"

namespace tilegrad::train {

Result<Predictor> Predictor::Load(const Path& path, const Workers& workers) {
  Predictor out;
  out.all_ = std::make_unique<Loaded>(workers);
  Loaded& all = *out.all_;
  TILEGRAD_ASSIGN(all.found, FindCheckpoint(all.context, path));
  const CheckpointInfo& info = out.info();
  if (info.image_size < 1 || info.image_size > 4096)
    return DataLoss("{}: image size {} is not possible", path.string(), info.image_size);
  if (!(info.half_extent > 0 && info.half_extent < 1e6))
    return DataLoss("{}: half-extent {} is not possible", path.string(), info.half_extent);
  if (IsOfFit(info.config))
    return InvalidArgument("{}: is a fit, which predicts nothing; name a run of tilegrad train",
                           path.string());
  TILEGRAD_ASSIGN(all.config, ParseConfig(info.config, path.string() + ": its configuration"));
  auto model = all.config.task->LoadModel(all.context, all.found.checkpoint);
  if (!model.ok()) return model.status().Within(path.string());
  all.model = std::move(model).value();
  all.found.checkpoint.tensors = {};
  return out;
}

Status Predictor::ExportWeights(const Path& file, const std::string& credits,
                                nn::StoredFloats floats) const {
  Checkpoint weights{info(), all_->model->weights()};
  if (weights.tensors.empty())
    return InternalError("a model of \"{}\" notes no weights", all_->config.kind);
  weights.info.credits = credits;
  TILEGRAD_ASSIGN(auto files, CarriedFiles(all_->context, checkpoint()));
  for (nn::NamedTensor& carried : files) weights.tensors.push_back(std::move(carried));
  return WriteWeights(all_->context, file, weights, floats);
}

Status Predictor::CheckImageSize(const Dataset& dataset) const {
  if (dataset.info().image_size == image_size()) return {};
  return InvalidArgument("{}: images are {} pixels a side, the network was trained on {}",
                         dataset.folder().string(), dataset.info().image_size, image_size());
}

std::string Predictor::description() const {
  return fmt::format("{} network, {} parameters, step {}", all_->config.name,
                     all_->model->parameters(), step());
}

Result<std::vector<Mesh>> Predictor::Predict(std::span<const std::uint8_t> images) const {
  const std::size_t bytes = 4 * static_cast<std::size_t>(image_size() * image_size());
  if (images.size() % bytes != 0)
    return InvalidArgument("images must be [N][4][{0}][{0}] bytes, got {1}", image_size(),
                           images.size());
  std::vector<Mesh> out;
  for (std::size_t at = 0; at < images.size(); at += Model::kImagesAtOnce * bytes) {
    const std::size_t size = std::min(Model::kImagesAtOnce * bytes, images.size() - at);
    const Status predicted = all_->model->Predict(images.subspan(at, size), &out);
    TILEGRAD_TRY(predicted.Within(RunFolderOf(checkpoint()).string()));
  }
  for (Mesh& mesh : out) {
    if (mesh.normals.empty()) mesh.normals = SmoothNormals(mesh);
    SetUnlit(mesh, "predicted");
  }
  return out;
}

}  // namespace tilegrad::train
