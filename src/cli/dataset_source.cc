// SPDX-License-Identifier: Apache-2.0
#include "cli/dataset_source.h"

#include <algorithm>

#include "base/error.h"
#include "io/mesh_file.h"

namespace tilegrad::cli {
namespace {

using train::ModelSource;
using Opened = Result<std::unique_ptr<ModelSource>>;

constexpr int kProceduralModels = 100;  // of each class, where --per-class does not say

// Models of packages: where they are installed, and how they are opened.
struct Package {
  std::string_view name;
  const char* folder;
  Opened (*open)(const Path& folder);
};
constexpr Package kPackages[] = {
    {"sweethome3d", train::kSweetHome3dFolder, train::SweetHome3dSource},
    {"planes", train::kGamesFolder, train::PlanesSource},
    {"ships", train::kGamesFolder, train::ShipsSource},
    {"cars", train::kGamesFolder, train::CarsSource}};
constexpr const char* kThirteen = "thirteen";  // all of them

const Package* FindPackage(std::string_view name) {
  const auto* found = std::find_if(std::begin(kPackages), std::end(kPackages),
                                   [&](const Package& package) { return package.name == name; });
  return found == std::end(kPackages) ? nullptr : found;
}

Opened OpenSeveral(const DatasetSourceRequest& request) {
  std::vector<std::string> names = request.sources;
  const std::string name = fmt::format("{}", fmt::join(names, "+"));
  if (!request.input.empty())
    return InvalidArgument("--input: --source {} reads several folders; leave it out", name);
  if (name == kThirteen) {
    names.clear();
    for (const Package& package : kPackages) names.emplace_back(package.name);
  }
  std::vector<std::unique_ptr<ModelSource>> sources;
  for (auto at = names.begin(); at != names.end(); ++at) {
    const Package* package = FindPackage(*at);
    if (package == nullptr || std::find(names.begin(), at, *at) != at) {
      return InvalidArgument(
          "--source {}: of several, each is sweethome3d, planes, ships or cars, and there once",
          name);
    }
    TILEGRAD_ASSIGN(auto source, package->open(package->folder));
    sources.push_back(std::move(source));
  }
  return train::CombineSources(name, std::move(sources));
}

}  // namespace

std::vector<std::string> DatasetSourceNames() {
  std::vector<std::string> names = {"shapenet", "folder", "procedural", "nmr", kThirteen};
  for (const Package& package : kPackages) names.emplace_back(package.name);
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
  if (request.sources.size() > 1 || name == kThirteen) return OpenSeveral(request);
  if (name == "procedural") {
    const int models = request.procedural_per_class;
    return train::ProceduralSource(models > 0 ? models : kProceduralModels, request.seed);
  }
  if (const Package* package = FindPackage(name))
    return package->open(request.input.empty() ? package->folder : request.input);
  if (request.input.empty()) return InvalidArgument("--source {} needs --input FOLDER", name);
  if (name == "folder") return train::FolderSource(request.input);
  if (name == "shapenet") return train::ShapeNetSource(request.input, request.split_list);
  return train::NmrSource(request.input);
}

}  // namespace tilegrad::cli
