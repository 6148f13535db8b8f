// SPDX-License-Identifier: Apache-2.0
// Models that lie in folders, one file each: any tree class/file.
#include <algorithm>
#include <map>
#include <set>

#include "base/error.h"
#include "base/file.h"
#include "base/hash.h"
#include "base/text.h"
#include "io/archive.h"
#include "io/mesh_file.h"
#include "train/data/sources/model_source.h"

namespace tilegrad::train {
namespace {

// Notes which files a reader asks for, and their contents or that they cannot be read.
class NotedFiles : public io::FileSource {
 public:
  explicit NotedFiles(const Path& folder) : files_(io::OpenFolder(folder)) {}

  Result<Bytes> Read(const std::string& name) const override {
    auto bytes = files_->Read(name);
    Hash hash;
    if (bytes.ok()) hash.AddBytes(bytes->data(), bytes->size());
    noted_[name] = bytes.ok() ? hash.Text() : kUnreadable;
    // io::LoadMesh notices a shortage by itself. All else, such as missing permission, is a fault
    // of this file, and must not stop those after it.
    if (bytes.status().code() == StatusCode::kIo)
      return InvalidArgument("{}", bytes.status().message());
    return bytes;
  }
  bool Exists(const std::string& name) const override {
    const bool exists = files_->Exists(name);
    if (!exists) noted_[name] = kUnreadable;
    return exists;
  }
  std::string Describe(const std::string& name) const override { return files_->Describe(name); }

  // "CONTENT NAME", each ended by NUL, by name.
  std::string Text() const {
    std::string text;
    for (const auto& [name, content] : noted_) text += content + " " + name + kEnd;
    return text;
  }
  // Whether the files of such a text, of which `name` must be one, are as they were then.
  bool Match(const std::string& text, const std::string& name) const {
    for (const std::string_view line : SplitText(text, kEnd)) {
      const std::size_t space = line.find(' ');
      if (space != std::string_view::npos)
        static_cast<void>(Read(std::string(line.substr(space + 1))));
    }
    return noted_.contains(name) && Text() == text;
  }

 private:
  static constexpr char kEnd = '\0';
  static constexpr const char* kUnreadable = "-";

  const std::shared_ptr<io::FileSource> files_;
  mutable std::map<std::string, std::string> noted_;  // hash of the content by name
};

class FileModels : public ModelSource {
 public:
  FileModels(std::vector<SourceEntry> entries, std::vector<IgnoredFile> ignored)
      : ModelSource({.name = "folder", .credits = {"Models of the user."}}) {
    entries_ = std::move(entries);
    ignored_ = std::move(ignored);
    SortEntries(&entries_);
  }
  Result<SourceModel> Load(std::size_t entry) const override {
    const NotedFiles files(FolderOf(entry));
    TILEGRAD_ASSIGN(io::LoadedMesh loaded, io::LoadMesh(files, NameOf(entry)));
    return SourceModel{std::move(loaded.mesh), std::move(loaded.warnings), files.Text()};
  }
  bool IsUnchanged(std::size_t entry, const std::string& inputs) const override {
    return NotedFiles(FolderOf(entry)).Match(inputs, NameOf(entry));
  }

 private:
  // That of the classes: textures may be in a folder beside the model's.
  Path FolderOf(std::size_t entry) const { return Path(FileOf(entry)).parent_path().parent_path(); }
  // CLASS/MODEL
  std::string NameOf(std::size_t entry) const {
    const Path file = FileOf(entry);
    return (file.parent_path().filename() / file.filename()).string();
  }
};

// Images, materials and buffers, which models name.
bool BelongsToModels(const Path& file) {
  static const std::set<std::string> endings = {".png", ".jpg", ".jpeg", ".bmp", ".tga",
                                                ".ppm", ".pgm", ".rgb",  ".bw",  ".rgba",
                                                ".sgi", ".mtl", ".bin"};
  const std::string ending = LowerCase(file.extension().string());
  return endings.count(ending) > 0;
}

// Without what file managers and version control hide: .git, ._chair.obj.
Result<std::vector<Path>> ListVisible(const Path& folder) {
  TILEGRAD_ASSIGN(std::vector<Path> paths, ListFolder(folder));
  std::erase_if(paths, [](const Path& path) { return path.filename().string().starts_with('.'); });
  return paths;
}

// Models of a folder CLASS/MODEL, and what was skipped.
class FolderList {
 public:
  Status Read(const Path& folder) {
    TILEGRAD_ASSIGN(const auto classes, ListVisible(folder));
    for (const Path& path : classes) {
      if (IsFolder(path))
        TILEGRAD_TRY(ReadClass(path));
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

  Status ReadClass(const Path& folder) {
    const auto files = ListVisible(folder);
    if (!files.ok()) {
      Ignore(folder, "cannot be listed");
      return {};
    }
    const std::size_t before = entries.size();
    for (const Path& file : *files) {
      if (IsFolder(file))
        ReadFolder(file);
      else if (IsModel(file))
        Add(folder, file);
      else if (!BelongsToModels(file))
        Ignore(file, "is not a supported format");
    }
    if (entries.size() == before) {
      Ignore(folder, "holds no model: no class");
      return {};
    }
    const std::string& name = entries.back().class_name;
    const auto [other, added] = folder_of_class_.emplace(name, folder);
    if (added) return {};
    return InvalidArgument("{} and {} would both be the class \"{}\"; rename one",
                           other->second.string(), folder.string(), name);
  }

  // Textures have folders of their own; models there would belong to no class.
  void ReadFolder(const Path& folder) {
    const auto files = ListVisible(folder);
    if (!files.ok() || std::any_of(files->begin(), files->end(), IsModel))
      Ignore(folder, "holds models one folder too deep: expected CLASS/MODEL");
  }

  void Add(const Path& class_folder, const Path& file) {
    const std::string stem = file.stem().string();
    entries.push_back({SafeFileName(class_folder.filename().string()), SafeFileName(stem), stem, "",
                       "", file.string()});
  }

  std::map<std::string, Path> folder_of_class_;
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
