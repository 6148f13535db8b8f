// SPDX-License-Identifier: Apache-2.0
#include "train/data/sources/package_textures.h"

#include <span>

#include "base/error.h"
#include "base/file.h"
#include "io/image_file.h"
#include "train/data/sources/model_source.h"

namespace tilegrad::train {
namespace {

// Images of `folder` stand in for those of the same name elsewhere.
class WithTextures : public io::FileSource {
 public:
  WithTextures(const io::FileSource& files, const std::string& folder)
      : files_(files), folder_(folder) {}
  Result<Bytes> Read(const std::string& name) const override { return files_.Read(Find(name)); }
  bool Exists(const std::string& name) const override { return files_.Exists(Find(name)); }
  std::string Describe(const std::string& name) const override {
    return files_.Describe(Find(name));
  }

 private:
  std::string Find(const std::string& name) const {
    const std::string here = (Path(folder_) / Path(name).filename()).string();
    return files_.Exists(here) ? here : name;
  }

  const io::FileSource& files_;
  const std::string& folder_;
};

// Replaces the file's materials, and drops warnings about them.
Status Paint(const io::FileSource& files, const std::string& image, io::LoadedMesh* loaded) {
  TILEGRAD_ASSIGN(const Bytes bytes, files.Read(image));
  TILEGRAD_ASSIGN(ImageU8 pixels, io::DecodeImage(bytes, files.Describe(image)));
  Mesh& mesh = loaded->mesh;
  if (mesh.corner_uvs.empty()) return DataLoss("{}: has no uv", files.Describe(image));
  mesh.textures = {{image, io::ToColor(std::move(pixels))}};
  mesh.materials.assign(1, {});
  mesh.materials[0].base_color = glm::vec4(1);
  mesh.materials[0].base_color_texture = 0;
  mesh.face_materials.clear();
  loaded->warnings.clear();
  return {};
}

// Folders of the archive that match the parts of a pattern, named by what its stars match.
void Match(const Path& archive, const Path& at, std::span<const Path> parts,
           const std::string& name, std::vector<TextureSet>* out) {
  if (parts.empty()) return;
  const Path& part = parts.front();
  if (part != "*") {
    if (parts.size() > 1) return Match(archive, at / part, parts.subspan(1), name, out);
    if (PathExists(archive / at / part)) out->push_back({name, at.string(), ""});
    return;
  }
  const auto folders = ListFolder(archive / at);
  if (!folders.ok()) return;
  for (const Path& folder : *folders) {
    if (!IsFolder(folder)) continue;
    const std::string own = folder.filename().string();
    Match(archive, at / own, parts.subspan(1), name.empty() ? own : name + "-" + own, out);
  }
}

}  // namespace

std::vector<TextureSet> FindTextureSets(std::string_view column, const Path& archive) {
  std::vector<TextureSet> sets;
  if (column.empty()) return {TextureSet()};
  while (!column.empty()) {
    const std::string part(column.substr(0, column.find('|')));
    column.remove_prefix(std::min(column.size(), part.size() + 1));
    if (part == ".") {
      sets.emplace_back();
    } else if (part.starts_with('=')) {
      sets.push_back({Path(part).stem().string(), "", part.substr(1)});
    } else {
      const Path path(part);
      const std::vector<Path> parts(path.begin(), path.end());
      Match(archive, "", parts, "", &sets);
    }
  }
  return sets;
}

Result<io::LoadedMesh> LoadWithTextures(const io::FileSource& files, const std::string& model,
                                        const TextureSet& textures) {
  if (!textures.folder.empty()) return io::LoadMesh(WithTextures(files, textures.folder), model);
  TILEGRAD_ASSIGN(io::LoadedMesh loaded, io::LoadMesh(files, model));
  if (!textures.image.empty()) TILEGRAD_TRY(Paint(files, textures.image, &loaded));
  return loaded;
}

}  // namespace tilegrad::train
