// SPDX-License-Identifier: Apache-2.0
// Where a COLMAP project has its models.
#include <algorithm>

#include "base/error.h"
#include "base/text.h"
#include "io/camera_file.h"

namespace tilegrad::io {
namespace {

bool IsModel(const Path& folder) {
  return IsFile(folder / "cameras.txt") || IsFile(folder / "cameras.bin");
}

// In a folder `sparse`, sorted.
std::vector<Path> ModelsIn(const Path& sparse) {
  std::vector<Path> models;
  std::error_code error;
  for (std::filesystem::directory_iterator at(sparse, error), end; !error && at != end;
       at.increment(error)) {
    if (IsModel(at->path())) models.push_back(at->path());
  }
  std::sort(models.begin(), models.end());
  return models;
}

// 0 where they cannot be read.
std::size_t CountImages(const Path& model) {
  const auto views = LoadColmapCameras(model, {.bent = true});
  return views.ok() ? views->size() : 0;
}

ColmapModel LargestOf(const std::vector<Path>& models) {
  std::vector<std::size_t> counts;
  for (const Path& model : models) counts.push_back(CountImages(model));
  const auto best =
      static_cast<std::size_t>(std::max_element(counts.begin(), counts.end()) - counts.begin());
  std::string others;
  for (std::size_t i = 0; i < models.size(); ++i) {
    if (i != best) others += fmt::format(", {} ({})", models[i].filename().string(), counts[i]);
  }
  return {models[best],
          fmt::format("{}: taken for its {}; other models of the project are left out: {}",
                      models[best].string(), Count(counts[best], "image"), others.substr(2))};
}

}  // namespace

std::optional<ColmapModel> FindColmapModel(const Path& folder) {
  for (const Path& root : {folder, folder / "colmap"}) {
    if (IsModel(root)) return ColmapModel{root, ""};
    const std::vector<Path> models = ModelsIn(root / "sparse");
    if (models.size() > 1) return LargestOf(models);
    if (models.size() == 1) return ColmapModel{models[0], ""};
    if (IsModel(root / "sparse")) return ColmapModel{root / "sparse", ""};
  }
  return std::nullopt;
}

}  // namespace tilegrad::io
