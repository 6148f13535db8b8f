// SPDX-License-Identifier: Apache-2.0
// Models of Debian's sweethome3d-furniture, by our list of classes.
#include <map>

#include "base/error.h"
#include "io/mesh_file.h"
#include "io/sh3f.h"
#include "train/data/sources/model_source.h"
#include "train/data/sources/package_models.h"

namespace tilegrad::train {
namespace {

struct Library {
  std::shared_ptr<io::FileSource> files;
  std::map<std::string, std::array<float, 9>> rotations;  // by model path, where there is one
};

// Columns of one line of the list.
struct FurnitureRow {
  std::string class_name, furniture_library, license, name, model, creator;
};

std::vector<FurnitureRow> ReadList() {
  std::vector<FurnitureRow> rows;
  for (std::string_view line : SplitText(SweetHome3dList(), '\n')) {
    const auto part = SplitText(line, '\t');
    if (part.size() != 7 || part[0] == "class") continue;
    rows.push_back({std::string(part[0]), std::string(part[1]), std::string(part[2]),
                    std::string(part[4]), std::string(part[5]), std::string(part[6])});
  }
  return rows;
}

Result<Library> OpenLibrary(const Path& path) {
  Library library;
  TILEGRAD_ASSIGN(library.files, io::OpenZip(path));
  TILEGRAD_ASSIGN(const io::FurnitureCatalog catalog, io::ReadFurnitureCatalog(*library.files));
  for (const io::FurnitureEntry& entry : catalog.entries) {
    if (entry.rotation) library.rotations[entry.model] = *entry.rotation;
  }
  return library;
}

class SweetHome3d : public ModelSource {
 public:
  SweetHome3d()
      : ModelSource({.name = "sweethome3d",
                     .credits = {"3D models: eTeks & Scopia (CC-BY 3.0), Kator Legaz (CC-BY 3.0 "
                                 "US), BlendSwap contributors (CC0 / CC-BY 3.0)."}}) {}

  static Result<std::unique_ptr<ModelSource>> Open(const Path& folder) {
    auto source = std::make_unique<SweetHome3d>();
    for (const FurnitureRow& row : ReadList()) TILEGRAD_TRY(source->Add(folder, row));
    SortEntries(&source->entries_);
    return std::unique_ptr<ModelSource>(std::move(source));
  }

  Result<SourceModel> Load(std::size_t entry) const override {
    const auto& [library_name, model] = models_.at(FileOf(entry));
    const Library& library = libraries_.at(library_name);
    TILEGRAD_ASSIGN(io::LoadedMesh loaded, io::LoadMesh(*library.files, model));
    const auto rotation = library.rotations.find(model);
    if (rotation != library.rotations.end()) io::ApplyRotation(loaded.mesh, rotation->second);
    return SourceModel{std::move(loaded.mesh), std::move(loaded.warnings)};
  }

 private:
  Status Add(const Path& folder, const FurnitureRow& row) {
    if (libraries_.count(row.furniture_library) == 0) {
      auto library = OpenLibrary(folder / (row.furniture_library + ".sh3f"));
      if (!library.ok() && library.status().code() == StatusCode::kNotFound)
        return NotFound(
            "{}; install the models with `sudo apt-get install --no-install-recommends "
            "sweethome3d-furniture`, or use --source procedural",
            library.status().message());
      if (!library.ok()) return library.status();
      libraries_.emplace(row.furniture_library, std::move(*library));
    }
    const std::string stem = Path(row.model).stem().string();
    const std::string file = fmt::format("{}.sh3f: {}", row.furniture_library, row.model);
    models_[file] = {row.furniture_library, row.model};
    entries_.push_back({row.class_name, SafeFileName(row.furniture_library + "-" + stem), row.name,
                        row.license, row.creator, file});
    return {};
  }

  std::map<std::string, Library> libraries_;
  std::map<std::string, std::pair<std::string, std::string>> models_;  // file -> library, model
};

}  // namespace

Result<std::unique_ptr<ModelSource>> SweetHome3dSource(const Path& folder) {
  return SweetHome3d::Open(folder);
}

}  // namespace tilegrad::train
