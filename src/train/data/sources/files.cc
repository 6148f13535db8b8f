// SPDX-License-Identifier: Apache-2.0
// Models that lie in folders, one file each: any tree class/file, and ShapeNetCore.
#include <map>
#include <sstream>

#include "base/error.h"
#include "io/mesh_file.h"
#include "train/data/sources/model_source.h"

namespace tilegrad::train {
namespace {

class FileModels : public ModelSource {
 public:
  FileModels(std::string name, std::string credit, std::vector<SourceEntry> entries)
      : name_(std::move(name)), credit_(std::move(credit)), entries_(std::move(entries)) {
    SortEntries(&entries_);
  }
  std::string name() const override { return name_; }
  std::vector<std::string> credits() const override { return {credit_}; }
  const std::vector<SourceEntry>& entries() const override { return entries_; }
  Result<SourceModel> Load(std::size_t entry) const override {
    TILEGRAD_ASSIGN(io::LoadedMesh loaded, io::LoadMesh(Path(entries_[entry].file)));
    return SourceModel{std::move(loaded.mesh), std::move(loaded.warnings)};
  }

 private:
  std::string name_, credit_;
  std::vector<SourceEntry> entries_;
};

// "synset/model" -> split.
using SplitList = std::map<std::string, Split>;

Result<SplitList> ReadSplitList(const Path& path) {
  TILEGRAD_ASSIGN(const std::string text, ReadText(path));
  const std::map<std::string, Split> names = {
      {"train", Split::kTrain}, {"val", Split::kValidation}, {"test", Split::kTest}};
  SplitList list;
  std::istringstream lines(text);
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    std::istringstream words(line);
    std::string model, split, more;
    if (!(words >> model)) continue;
    if (!(words >> split) || (words >> more) || names.count(split) == 0) {
      return DataLoss("{}: line {}: expected \"<synset>/<model> <train|val|test>\"", path.string(),
                      number);
    }
    list[model] = names.at(split);
  }
  if (list.empty()) return DataLoss("{}: lists no models", path.string());
  return list;
}

bool IsFolder(const Path& path) {
  std::error_code error;
  return std::filesystem::is_directory(path, error);
}

}  // namespace

Result<std::unique_ptr<ModelSource>> FolderSource(const Path& folder) {
  std::vector<SourceEntry> entries;
  TILEGRAD_ASSIGN(const auto classes, ListFolder(folder));
  for (const Path& class_folder : classes) {
    if (!IsFolder(class_folder)) continue;
    TILEGRAD_ASSIGN(const auto files, ListFolder(class_folder));
    for (const Path& file : files) {
      if (!io::IsMeshFileName(file.filename().string())) continue;
      const std::string stem = file.stem().string();
      entries.push_back({SafeFileName(class_folder.filename().string()),
                         SafeFileName(stem),
                         stem,
                         "",
                         "",
                         file.string(),
                         {}});
    }
  }
  if (entries.empty()) {
    return NotFound("{}: no models; expected <class>/<model> with one of {}", folder.string(),
                    io::MeshFileEndings());
  }
  return std::unique_ptr<ModelSource>(
      std::make_unique<FileModels>("folder", "Models of the user.", std::move(entries)));
}

Result<std::unique_ptr<ModelSource>> ShapeNetSource(const Path& folder, const Path& split_list) {
  SplitList list;
  if (!split_list.empty()) {
    TILEGRAD_ASSIGN(list, ReadSplitList(split_list));
  }
  std::vector<SourceEntry> entries;
  TILEGRAD_ASSIGN(const auto synsets, ListFolder(folder));
  for (const Path& synset : synsets) {
    const std::string id = synset.filename().string(), class_name = SynsetName(id);
    if (class_name == id || !IsFolder(synset)) continue;
    TILEGRAD_ASSIGN(const auto models, ListFolder(synset));
    for (const Path& model : models) {
      const std::string name = model.filename().string();
      const auto listed = list.find(id + "/" + name);
      if (!IsFolder(model) || (!list.empty() && listed == list.end())) continue;
      std::optional<Split> split;
      if (listed != list.end()) split = listed->second;
      const Path file = model / "models" / "model_normalized.obj";
      entries.push_back({class_name, SafeFileName(name), name, "ShapeNet terms of use", "",
                         file.string(), split});
    }
  }
  if (entries.empty()) {
    return NotFound("{}: no models{}; expected <synset>/<model>/models/model_normalized.obj",
                    folder.string(), list.empty() ? "" : " that " + split_list.string() + " names");
  }
  return std::unique_ptr<ModelSource>(std::make_unique<FileModels>(
      "shapenet", "3D models: ShapeNetCore (Chang et al. 2015).", std::move(entries)));
}

}  // namespace tilegrad::train
