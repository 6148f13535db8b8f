// SPDX-License-Identifier: Apache-2.0
// ShapeNetCore as it is unpacked:
//
//   SYNSET/MODEL/model.obj                       version 1: faces +x
//   SYNSET/MODEL/models/model_normalized.obj     version 2: faces -z
//
// Both have y up. That the fronts are a quarter turn apart is what programs undo that take both.
#include <algorithm>
#include <array>

#include "base/error.h"
#include "io/mesh_file.h"
#include "io/sh3f.h"
#include "train/data/sources/model_source.h"
#include "train/data/sources/split_list.h"

namespace tilegrad::train {
namespace {

constexpr const char *kFileOfV1 = "model.obj", *kFileOfV2 = "models/model_normalized.obj";

// To +z.
constexpr std::array<float, 9> kTurnOfV1 = {0, 0, -1, 0, 1, 0, 1, 0, 0},
                               kTurnOfV2 = {-1, 0, 0, 0, 1, 0, 0, 0, -1};

class ShapeNet : public ModelSource {
 public:
  explicit ShapeNet(const Path& folder)
      : ModelSource({.name = "shapenet",
                     .credits = {"3D models: ShapeNetCore (Chang et al. 2015)."},
                     .input = std::filesystem::absolute(folder).string(),
                     .published = true,
                     .version = kRulesVersion}),
        folder_(folder) {}

  Status List(const SplitList& list) {
    TILEGRAD_ASSIGN(const auto synsets, ListFolder(folder_));
    for (const Path& synset : synsets) {
      const std::string id = synset.filename().string();
      if (SynsetName(id) != id && IsFolder(synset)) TILEGRAD_TRY(ListClass(synset, list));
    }
    if (entries_.empty())
      return NotFound("{}: no models{}; expected <synset>/<model>/{} or <synset>/<model>/{}",
                      folder_.string(), list.empty() ? "" : " that the list names", kFileOfV1,
                      kFileOfV2);
    SortEntries(&entries_);
    return {};
  }

  Result<SourceModel> Load(std::size_t entry) const override {
    const Path file = FileOf(entry);
    TILEGRAD_ASSIGN(io::LoadedMesh loaded, io::LoadMesh(file));
    if (!loaded.lost_appearance.empty())
      return loaded.lost_appearance.front().Within(file.string());
    io::ApplyRotation(loaded.mesh, file.filename() == kFileOfV1 ? kTurnOfV1 : kTurnOfV2);
    return SourceModel{std::move(loaded.mesh), std::move(loaded.warnings)};
  }

 private:
  static constexpr std::uint64_t kRulesVersion = 2;  // 1 did not turn models

  Status ListClass(const Path& synset, const SplitList& list) {
    const std::string id = synset.filename().string();
    TILEGRAD_ASSIGN(const auto models, ListFolder(synset));
    if (std::none_of(models.begin(), models.end(), IsFolder))
      ignored_.push_back({synset.string(), "holds no model: no class"});
    for (const Path& model : models) {
      const std::string name = model.filename().string();
      const Listing listing = list.Of(id, name);
      if (!listing.used || !IsFolder(model)) continue;
      const Path v1 = model / kFileOfV1;
      entries_.push_back({SynsetName(id), SafeFileName(name), name, "ShapeNet terms of use", "",
                          (PathExists(v1) ? v1 : model / kFileOfV2).string(), listing.split});
    }
    return {};
  }

  const Path folder_;
};

}  // namespace

Result<std::unique_ptr<ModelSource>> ShapeNetSource(const Path& folder, const SplitList& list) {
  auto source = std::make_unique<ShapeNet>(folder);
  TILEGRAD_TRY(source->List(list));
  return std::unique_ptr<ModelSource>(std::move(source));
}

}  // namespace tilegrad::train
