// SPDX-License-Identifier: Apache-2.0
// Models that lie in folders, one file each: any tree class/file.
#include <algorithm>
#include <set>

#include "base/error.h"
#include "base/file.h"
#include "base/text.h"
#include "io/mesh_file.h"
#include "train/data/sources/model_source.h"

namespace tilegrad::train {
namespace {

class FileModels : public ModelSource {
 public:
  FileModels(std::vector<SourceEntry> entries, std::vector<IgnoredFile> ignored)
      : ModelSource({.name = "folder", .credits = {"Models of the user."}}) {
    entries_ = std::move(entries);
    ignored_ = std::move(ignored);
    SortEntries(&entries_);
  }
  Result<SourceModel> Load(std::size_t entry) const override {
    TILEGRAD_ASSIGN(io::LoadedMesh loaded, io::LoadMesh(Path(FileOf(entry))));
    return SourceModel{std::move(loaded.mesh), std::move(loaded.warnings)};
  }
};

// Images, materials and buffers, which models name; and what file managers hide.
bool BelongsToModels(const Path& file) {
  static const std::set<std::string> endings = {".png", ".jpg", ".jpeg", ".bmp", ".tga",
                                                ".ppm", ".pgm", ".rgb",  ".bw",  ".rgba",
                                                ".sgi", ".mtl", ".bin"};
  const std::string ending = LowerCase(file.extension().string());
  return file.filename().string().starts_with('.') || endings.count(ending) > 0;
}

// Models of a folder CLASS/MODEL, and what was skipped.
class FolderList {
 public:
  Status Read(const Path& folder) {
    TILEGRAD_ASSIGN(const auto classes, ListFolder(folder));
    for (const Path& path : classes) {
      if (IsFolder(path))
        ReadClass(path);
      else if (IsModel(path))
        Ignore(path, "is not in a class folder: expected CLASS/MODEL");
      else if (!BelongsToModels(path))
        Ignore(path, "is not a model");
    }
    return {};
  }

  std::vector<SourceEntry> entries;
  std::vector<IgnoredFile> ignored;

 private:
  static bool IsModel(const Path& path) { return io::IsMeshFileName(path.filename().string()); }
  void Ignore(const Path& path, const std::string& reason) {
    ignored.push_back({path.string(), reason});
  }

  void ReadClass(const Path& folder) {
    const auto files = ListFolder(folder);
    if (!files.ok()) return Ignore(folder, "cannot be listed");
    const std::size_t before = entries.size();
    for (const Path& file : *files) {
      if (IsFolder(file))
        ReadFolder(file);
      else if (IsModel(file))
        Add(folder, file);
      else if (!BelongsToModels(file))
        Ignore(file, "is not a supported format");
    }
    if (entries.size() == before) Ignore(folder, "holds no model: no class");
  }

  // Textures have folders of their own; models there would belong to no class.
  void ReadFolder(const Path& folder) {
    const auto files = ListFolder(folder);
    if (!files.ok() || std::any_of(files->begin(), files->end(), IsModel))
      Ignore(folder, "holds models one folder too deep: expected CLASS/MODEL");
  }

  void Add(const Path& class_folder, const Path& file) {
    const std::string stem = file.stem().string();
    entries.push_back({SafeFileName(class_folder.filename().string()), SafeFileName(stem), stem, "",
                       "", file.string()});
  }
};

}  // namespace

Result<std::unique_ptr<ModelSource>> FolderSource(const Path& folder) {
  FolderList list;
  TILEGRAD_TRY(list.Read(folder));
  if (list.entries.empty()) {
    const std::size_t ignored = list.ignored.size();
    return NotFound("{}: no models; expected <class>/<model> with one of {}{}", folder.string(),
                    io::MeshFileEndings(),
                    ignored == 0
                        ? ""
                        : fmt::format("; of what is there, {} {}{}", list.ignored[0].file,
                                      list.ignored[0].reason, ignored == 1 ? "" : ", and so on"));
  }
  return std::unique_ptr<ModelSource>(
      std::make_unique<FileModels>(std::move(list.entries), std::move(list.ignored)));
}

}  // namespace tilegrad::train
