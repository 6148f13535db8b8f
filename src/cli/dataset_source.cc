// SPDX-License-Identifier: Apache-2.0
#include "cli/dataset_source.h"

#include "base/error.h"
#include "io/mesh_file.h"
#include "train/data/sources/installed.h"

namespace tilegrad::cli {
namespace {

using train::ModelSource;
using Opened = Result<std::unique_ptr<ModelSource>>;

constexpr int kProceduralModels = 100;  // of each class, where --per-class does not say

Opened OpenSeveral(const DatasetSourceRequest& request) {
  const std::string name = fmt::format("{}", fmt::join(request.sources, "+"));
  if (!request.input.empty())
    return InvalidArgument("--input: --source {} reads several folders; leave it out", name);
  return train::OpenInstalledSources(name);
}

}  // namespace

std::vector<std::string> DatasetSourceNames() {
  std::vector<std::string> names = {"shapenet", "folder", "procedural", "nmr", train::kThirteen};
  for (const auto& source : train::InstalledSources()) names.emplace_back(source.name);
  return names;
}

std::string DatasetSourceHelp() {
  return "where models come from: sweethome3d (Debian package sweethome3d-furniture), planes "
         "(flightgear-data-ai), ships (flightgear-data-models), cars (torcs-data, "
         "trigger-rally-data, ufoai-data), several of these with commas between, thirteen (all of "
         "these), shapenet (SYNSET/MODEL/models/model_normalized.obj), folder (CLASS/MODEL with "
         "one of " +
         io::MeshFileEndings() + "), procedural (built in), nmr (.npz renders of N3MR and SoftRas)";
}

Opened OpenDatasetSource(const DatasetSourceRequest& request) {
  const std::string& name = request.sources.front();
  if (request.sources.size() > 1 || name == train::kThirteen) return OpenSeveral(request);
  if (name == "procedural") {
    const int models = request.procedural_per_class;
    return train::ProceduralSource(models > 0 ? models : kProceduralModels, request.seed);
  }
  if (const auto* installed = train::FindInstalledSource(name))
    return installed->open(request.input.empty() ? installed->folder : request.input);
  if (request.input.empty()) return InvalidArgument("--source {} needs --input FOLDER", name);
  if (name == "folder") return train::FolderSource(request.input);
  if (name == "shapenet") return train::ShapeNetSource(request.input, request.split_list);
  return train::NmrSource(request.input);
}

}  // namespace tilegrad::cli
