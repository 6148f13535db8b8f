// SPDX-License-Identifier: Apache-2.0
#include "raster/furniture.h"

#include <algorithm>

#include "base/error.h"
#include "train/data/sources/model_source.h"

namespace tilegrad::bench {
namespace {

Result<Mesh> LoadFirst(const train::ModelSource& source, const std::string& class_name) {
  const auto& entries = source.entries();
  const auto at = std::find_if(entries.begin(), entries.end(), [&](const train::SourceEntry& e) {
    return e.class_name == class_name;
  });
  if (at == entries.end()) return NotFound("no model of class {}", class_name);
  TILEGRAD_ASSIGN(train::SourceModel model,
                  source.Load(static_cast<std::size_t>(at - entries.begin())));
  Mesh mesh = std::get<Mesh>(std::move(model.data));
  TILEGRAD_TRY(NormalizeToBox(mesh, 0.45f));
  return mesh;
}

}  // namespace

Result<std::vector<FurnitureMesh>> LoadFurniture() {
  TILEGRAD_ASSIGN(const auto source, train::SweetHome3dSource(train::kSweetHome3dFolder));
  std::vector<FurnitureMesh> out;
  for (const char* name : {"chair", "car", "plant"}) {
    TILEGRAD_ASSIGN(Mesh mesh, LoadFirst(*source, name));
    out.push_back({name, std::move(mesh)});
  }
  return out;
}

}  // namespace tilegrad::bench
