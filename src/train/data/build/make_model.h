// SPDX-License-Identifier: Apache-2.0
// Makes the data that a dataset keeps of one loaded model.
#pragma once

#include <string>

#include "render/picture/mesh_pictures.h"
#include "render/picture/mesh_scene.h"
#include "train/data/dataset_files.h"
#include "train/data/sources/model_source.h"

namespace tilegrad::train {

struct MadeModel {
  ModelData data;
  ModelStamp stamp;
};

// Prepares, renders, voxelises, samples (seeded by class and id) and, for reports, simplifies a
// model. A pure function of the model, the entry and `info`.
Result<MadeModel> MakeModel(const SourceEntry& entry, SourceModel model, const DatasetInfo& info,
                            LitRenderer& renderer);

// Removes faces of glass, because people see what is behind them, unless nothing would be left.
// Everything else counts as opaque.
void RemoveGlass(Mesh* mesh);

// A source's mesh as the dataset shows it: without glass, upright, centred and scaled to
// the rule's half-extent.
Status PrepareMesh(const DatasetInfo& info, Mesh* mesh);

// 16 hex digits that change whenever model files would: `info`'s sizes and camera, the source's
// name and version (ModelSource::version), and a version of the rules.
std::string RecipeOf(const DatasetInfo& info, std::uint64_t version);

}  // namespace tilegrad::train
