// SPDX-License-Identifier: Apache-2.0
#include "train/data/dataset.h"

#include <algorithm>
#include <iterator>
#include <set>

#include "base/error.h"
#include "base/file.h"
#include "train/data/dataset_files.h"

namespace tilegrad::train {

Camera CameraRule::View(int index) const {
  return OrbitCamera(lens, azimuth_step * index, elevation, distance);
}

std::vector<Camera> CamerasOf(const DatasetInfo& info, const std::vector<Camera>& own) {
  std::vector<Camera> cameras = own;
  for (int v = static_cast<int>(own.size()); v < info.views; ++v)
    cameras.push_back(info.camera.View(v));
  return cameras;
}

std::vector<int> SpreadViews(int views, int count) {
  std::vector<int> out;
  for (int i = 0; i < count; ++i) out.push_back(i * views / count);
  return out;
}

std::span<const std::uint8_t> ViewOf(const DatasetInfo& info, std::span<const std::uint8_t> images,
                                     int view) {
  const std::size_t bytes = images.size() / static_cast<std::size_t>(info.views);
  return images.subspan(static_cast<std::size_t>(view) * bytes, bytes);
}

std::vector<std::uint8_t> ViewsOf(const DatasetInfo& info, std::span<const std::uint8_t> images,
                                  std::span<const int> views) {
  std::vector<std::uint8_t> out;
  for (const int view : views) {
    const auto image = ViewOf(info, images, view);
    out.insert(out.end(), image.begin(), image.end());
  }
  return out;
}

std::size_t CountShapes(const std::vector<ModelInfo>& models) {
  std::set<std::pair<int, std::string>> shapes;
  for (const ModelInfo& model : models) shapes.emplace(model.class_index, ShapeOf(model));
  return shapes.size();
}

std::optional<std::string> AdviceOnFewModels(const std::vector<ModelInfo>& models, bool streamed) {
  std::vector<ModelInfo> training;
  std::copy_if(models.begin(), models.end(), std::back_inserter(training),
               [](const ModelInfo& model) { return model.split == Split::kTrain; });
  const std::size_t shapes = CountShapes(training);
  if (shapes >= (streamed ? kFewStreamedShapes : kFewShapes)) return std::nullopt;
  return fmt::format(
      "{} training shape{} few{}: a network memorises {} and does not generalise. Add models "
      "(--source procedural makes any number, --per-class), {}or, for one object, use `tilegrad "
      "fit`",
      shapes, shapes == 1 ? " is" : "s are",
      streamed ? ", also with streamed variants of each" : "", shapes == 1 ? "it" : "them",
      streamed ? "" : "train with --set stream.share=0.5 --set schedule.mirrored=0.5, ");
}

Result<Dataset> Dataset::Open(const Path& folder) {
  Dataset dataset;
  dataset.folder_ = folder;
  if (!PathExists(folder)) return NotFound("{}: no such folder", folder.string());
  if (!PathExists(DatasetInfoPath(folder)))
    return NotFound("{}: not a folder of tilegrad dataset: there is no dataset.json in it",
                    folder.string());
  TILEGRAD_ASSIGN(dataset.info_, ReadDatasetInfo(folder));
  if (!PathExists(ModelsPath(folder)))
    return NotFound(
        "{}: the dataset is not complete; run the same `tilegrad dataset` command again to finish "
        "it",
        folder.string());
  TILEGRAD_ASSIGN(dataset.models_, ReadModels(folder, dataset.info_));
  return dataset;
}

std::vector<int> Dataset::Select(Split split) const {
  std::vector<int> out;
  for (std::size_t i = 0; i < models_.size(); ++i) {
    if (models_[i].split == split) out.push_back(static_cast<int>(i));
  }
  return out;
}

Path Dataset::ModelPath(int model) const {
  const ModelInfo& info = this->model(model);
  return ModelFilePath(folder_, ClassOf(info), info.id);
}

Result<ModelData> Dataset::Load(int model) const { return LoadModelFile(ModelPath(model), info_); }

Result<std::vector<std::uint8_t>> Dataset::LoadImages(int model) const {
  return LoadModelImages(ModelPath(model), info_);
}

Result<std::vector<Camera>> Dataset::LoadCameras(int model) const {
  if (!info_.own_cameras) return CamerasOf(info_, {});
  return LoadModelCameras(ModelPath(model), info_);
}

}  // namespace tilegrad::train
