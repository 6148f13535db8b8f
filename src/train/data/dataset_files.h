// SPDX-License-Identifier: Apache-2.0
// The files of a dataset (listed in dataset.h): writes them, and reads them back with every size
// checked.
#pragma once

#include <string>
#include <vector>

#include "train/data/dataset.h"

namespace tilegrad::train {

// A model that could not be used, and why.
struct RejectedModel {
  std::string id, class_name;
  std::string file;  // where it came from
  std::string reason;
};

// The metadata of a model file.
struct ModelStamp {
  std::string recipe;          // of its dataset, DatasetInfo::recipe
  std::uint64_t geometry = 0;  // as ModelInfo::geometry
  int source_faces = 0;        // as ModelInfo::source_faces
  std::string inputs = {};     // as SourceModel::inputs; any bytes
};

const char* SplitName(Split split);  // "train", "validation", "test"

Path DatasetInfoPath(const Path& folder);
Path ModelsPath(const Path& folder);
Path RejectedPath(const Path& folder);
Path ContactSheetPath(const Path& folder);
Path PicturesPath(const Path& folder);  // picture_pack.h
Path ModelFilePath(const Path& folder, const std::string& class_name, const std::string& id);
// Removes the files of a dataset and keeps others in its folder.
Status RemoveDataset(const Path& folder);

Status WriteDatasetInfo(const Path& folder, const DatasetInfo& info);
Result<DatasetInfo> ReadDatasetInfo(const Path& folder);
Status WriteModels(const Path& folder, const DatasetInfo& info,
                   const std::vector<ModelInfo>& models);
Result<std::vector<ModelInfo>> ReadModels(const Path& folder, const DatasetInfo& info);
Status WriteRejected(const Path& folder, const std::vector<RejectedModel>& rejected);

// Compressed; the same data gives the same bytes.
Status SaveModelFile(const Path& path, const DatasetInfo& info, const ModelData& data,
                     const ModelStamp& stamp);
Result<ModelData> LoadModelFile(const Path& path, const DatasetInfo& info);
Result<std::vector<std::uint8_t>> LoadModelImages(const Path& path, const DatasetInfo& info);
// For a dataset with DatasetInfo::own_cameras.
Result<std::vector<Camera>> LoadModelCameras(const Path& path, const DatasetInfo& info);
// Reads the whole file; an error if it is broken or belongs to another recipe.
Result<ModelStamp> VerifyModelFile(const Path& path, const DatasetInfo& info);

}  // namespace tilegrad::train
