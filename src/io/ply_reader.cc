// SPDX-License-Identifier: Apache-2.0
// Stanford PLY, text and binary of both byte orders. Not read by Assimp, whose reader reads past
// the end of a file with a wrong header or list.
#include <map>

#include "base/error.h"
#include "io/mesh_readers.h"
#include "io/ply_body.h"
#include "io/ply_header.h"
#include "io/text_scan.h"

namespace tilegrad::io {
namespace {

// A material for each image that faces name by their number, and a white one.
class PlyTextures {
 public:
  PlyTextures(const PlyHeader& header, const FileSource& source, const std::string& name,
              LoadedMesh& out)
      : header_(header), source_(source), name_(name), out_(out) {}

  void Add(const std::vector<double>& images) {
    const std::size_t count = header_.textures.size();
    if (count == 0) return;
    if (out_.mesh.corner_uvs.empty()) {
      out_.warnings.push_back("textures left out: the file has no texture coordinates");
      return;
    }
    if (images.empty()) {
      MaterialOf(0);
      if (count > 1)
        out_.warnings.push_back("textures but the first left out: faces have no texnumber");
    }
    for (const double image : images) out_.mesh.face_materials.push_back(MaterialOf(image));
  }

 private:
  std::int32_t MaterialOf(double image) {
    const bool known = image >= 0 && image < static_cast<double>(header_.textures.size());
    const std::size_t index = known ? static_cast<std::size_t>(image) : header_.textures.size();
    const auto next = static_cast<std::int32_t>(out_.mesh.materials.size());
    const auto [found, added] = materials_.try_emplace(index, next);
    if (!added) return found->second;
    Material material{.name = known ? header_.textures[index] : "", .base_color = glm::vec4(1)};
    if (known) {
      material.base_color_texture = AddTexture(source_, name_, material.name, out_);
    } else {
      out_.warnings.push_back(fmt::format("a face has texnumber {}, but the file has {} textures",
                                          image, header_.textures.size()));
    }
    out_.mesh.materials.push_back(std::move(material));
    return next;
  }

  const PlyHeader& header_;
  const FileSource& source_;
  const std::string& name_;
  LoadedMesh& out_;
  std::map<std::size_t, std::int32_t> materials_;
};

}  // namespace

Result<LoadedMesh> ReadPly(const FileSource& source, const std::string& name) {
  TILEGRAD_ASSIGN(const Bytes bytes, source.Read(name));
  const std::string place = source.Describe(name);
  TILEGRAD_ASSIGN(const PlyHeader header, ParsePlyHeader(TextOf(bytes), place));
  LoadedMesh out;
  TILEGRAD_ASSIGN(const std::vector<double> images, ReadPlyBody(header, place, out));
  PlyTextures(header, source, name, out).Add(images);
  return out;
}

}  // namespace tilegrad::io
