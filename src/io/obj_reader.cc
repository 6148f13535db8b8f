// SPDX-License-Identifier: Apache-2.0
// Wavefront OBJ with MTL: the file's vertices in its order, once each; per-corner uvs and normals;
// per-face materials.
#include <algorithm>
#include <glm/geometric.hpp>
#include <map>
#include <set>

#include "base/error.h"
#include "io/mesh_readers.h"
#include "io/obj_statements.h"
#include "io/text_scan.h"

namespace tilegrad::io {
namespace {

// The materials of all libraries of a file, by name.
class ObjLibraries {
 public:
  // Warnings and losses go to `out`.
  ObjLibraries(const FileSource& source, const std::string& obj_name, LoadedMesh& out)
      : source_(source), obj_name_(obj_name), out_(out) {}

  // Reads the argument of mtllib: names, separated by spaces or quotes, or one that contains
  // spaces.
  Status Read(std::string_view names) {
    if (const auto whole = Find(WholeName(names))) return ReadFile(*whole);
    std::string missing;
    while (!(names = Trimmed(names)).empty()) {
      std::string_view name;
      if (const auto file = TakeName(names, name)) {
        TILEGRAD_TRY(ReadFile(*file));
      } else {
        missing.append(missing.empty() ? "" : " ").append(name);
      }
    }
    if (!missing.empty()) return ReadFallback(missing);
    return {};
  }

  // Null if no library has it.
  const MtlMaterial* Get(const std::string& name) const {
    for (const auto& [map, key] :
         {std::pair(&materials_, name), std::pair(&materials_, std::string(WithoutComment(name))),
          std::pair(&commented_, name)}) {
      if (const auto found = map->find(key); found != map->end()) return &found->second;
    }
    return nullptr;
  }

  // The only material of all libraries, or null.
  const MtlMaterial* Only() const {
    return materials_.size() == 1 ? &materials_.begin()->second : nullptr;
  }
  std::set<std::string, std::less<>> Names() const {
    std::set<std::string, std::less<>> names;
    for (const auto& [name, material] : materials_) names.insert(name);
    return names;
  }

 private:
  std::optional<std::string> Find(std::string_view name) const {
    return FindBeside(source_, obj_name_, name);
  }

  // Takes the longest prefix that is a file's name, or else one word.
  std::optional<std::string> TakeName(std::string_view& names, std::string_view& name) const {
    constexpr int kMostWords = 16;
    const std::string_view all = names;
    std::optional<std::string> file;
    if (all.starts_with('"')) {
      const auto end = std::min(all.find('"', 1), all.size());
      name = all.substr(1, end - 1);
      names.remove_prefix(std::min(end + 1, all.size()));
      return Find(name);
    }
    NextToken(names);
    name = all.substr(0, all.size() - names.size());
    std::string_view rest = names;
    for (int words = 0; words < kMostWords; ++words) {
      const std::string_view longer = all.substr(0, all.size() - rest.size());
      if (auto found = Find(longer)) {
        file = std::move(found);
        names = rest;
      }
      if (NextToken(rest).empty()) break;
    }
    return file;
  }

  Status ReadFile(const std::string& file) {
    if (!read_.insert(file).second) return {};
    const std::string place = source_.Describe(file);
    TILEGRAD_ASSIGN(const Bytes bytes, source_.Read(file));
    TILEGRAD_ASSIGN(MtlLibrary library, ParseMtl(TextOf(bytes), place));
    for (MtlMaterial& material : library.materials) Define(std::move(material));
    if (!library.not_read.empty())
      out_.Warn("{}: statements that are not read: {}", file, ShortList(library.not_read));
    return {};
  }

  void Define(MtlMaterial material) {
    const std::string bare(WithoutComment(material.name));  // "#25" is no comment, "# shiny" is
    if (material.name.find("# ", bare.size()) != std::string::npos)
      commented_.try_emplace(bare, material);
    const auto [found, added] = materials_.try_emplace(material.name, material);
    if (added || found->second == material) return;
    out_.Warn("material \"{}\" is defined more than once; the last one is used", found->first);
    found->second = std::move(material);
  }

  // Exporters rename files and forget the reference: the library may have the mesh's name.
  Status ReadFallback(const std::string& missing) {
    const std::string own = Path(obj_name_).stem().string() + ".mtl";
    const auto file = Find(own);
    out_.Warn("material library \"{}\" not found{}", missing,
              file ? "; " + own + " is read instead" : "");
    if (file) return ReadFile(*file);
    out_.lost_appearance.push_back(NotFound("{}: no such material library", missing));
    return {};
  }

  const FileSource& source_;
  const std::string& obj_name_;
  LoadedMesh& out_;
  std::map<std::string, MtlMaterial> materials_;
  std::map<std::string, MtlMaterial> commented_;  // by names without their comments
  std::set<std::string> read_;
};

class ObjAssembly {
 public:
  ObjAssembly(ObjStatements from, const FileSource& source, const std::string& name)
      : from_(std::move(from)), source_(source), name_(name) {}

  Result<LoadedMesh> Run() {
    out_.warnings = std::move(from_.warnings);
    out_.exact = std::move(from_.positions);
    out_.mesh.colors = std::move(from_.colors);
    ObjLibraries libraries(source_, name_, out_);
    for (const std::string& names : from_.libraries) TILEGRAD_TRY(libraries.Read(names));
    std::size_t first = 0;
    for (const ObjPolygon& polygon : from_.polygons) {
      const std::span corners(&from_.corners[first], polygon.corners);
      first += polygon.corners;
      AddPolygon(corners, MaterialOf(polygon.material, libraries));
    }
    AddWarnings();
    AddTables();
    return std::move(out_);
  }

 private:
  struct FaceMaterial {
    std::int32_t index;  // in the mesh
    glm::vec2 uv_scale, uv_offset;
    bool textured;
  };

  // Whether any corner has a uv (1), a normal (2).
  bool Any(std::size_t kind) const {
    return std::any_of(from_.corners.begin(), from_.corners.end(),
                       [&](const ObjCorner& corner) { return corner[kind] >= 0; });
  }

  // Converted at first use, so that materials without a face ask for no texture.
  const FaceMaterial& MaterialOf(std::int32_t index, const ObjLibraries& libraries) {
    const auto [found, added] = used_.try_emplace(index);
    if (!added) return found->second;
    const std::string name = index < 0 ? "" : from_.materials[static_cast<std::size_t>(index)];
    const MtlMaterial* known = index < 0 ? Unnamed(libraries) : libraries.Get(name);
    if (known == nullptr && index >= 0) unknown_.insert(name);
    const MtlMaterial from = known == nullptr ? MtlMaterial{.name = name} : *known;
    const auto place = static_cast<std::int32_t>(out_.mesh.materials.size());
    out_.mesh.materials.push_back(Convert(from));
    const bool textured = out_.mesh.materials.back().base_color_texture >= 0;
    return found->second = {place, from.image.scale, from.image.offset, textured};
  }

  // For faces before any usemtl: null, unless there is only one material.
  const MtlMaterial* Unnamed(const ObjLibraries& libraries) {
    const MtlMaterial* const only = from_.materials.empty() ? libraries.Only() : nullptr;
    if (const auto names = libraries.Names(); !names.empty()) {
      out_.warnings.push_back(
          only ? fmt::format("no usemtl in the file: drawn with \"{}\", the only material of its "
                             "library",
                             only->name)
               : fmt::format("faces before the first usemtl are white; the library has {}",
                             ShortList(names)));
    }
    return only;
  }

  Material Convert(const MtlMaterial& from) {
    Material material;
    material.name = from.name;
    material.base_color = glm::vec4(from.diffuse, from.opacity);
    if (from.image.name.empty()) return material;
    if (!any_uv_) {
      corners_without_uv_ = true;
      return material;
    }
    const bool whole = FindBeside(source_, name_, from.image.name).has_value();
    const std::string image(whole ? from.image.name : WithoutComment(from.image.name));
    material.base_color_texture = AddTexture(source_, name_, image, out_);
    material.wrap.fill(from.image.clamp ? TextureWrap::kClamp : TextureWrap::kRepeat);
    // With a texture, exporters often leave Kd black or grey; use the image alone.
    if (material.base_color_texture >= 0) material.base_color = {1, 1, 1, from.opacity};
    return material;
  }

  void AddPolygon(std::span<const ObjCorner> corners, const FaceMaterial& material) {
    polygon_.corners.clear();
    for (const ObjCorner& corner : corners) polygon_.corners.push_back(corner[0]);
    polygon_.AddTo(out_);
    for (const Face& triangle : polygon_.triangles) {
      out_.mesh.face_materials.push_back(material.index);
      for (const std::int32_t k : triangle) {
        const ObjCorner& corner = corners[static_cast<std::size_t>(k)];
        if (any_uv_) AddUv(corner[1], material);
        if (any_normal_) AddNormal(corner[2]);
      }
    }
  }

  void AddUv(std::int32_t index, const FaceMaterial& material) {
    if (index < 0 && material.textured) corners_without_uv_ = true;
    out_.mesh.corner_uvs.push_back(
        index < 0 ? glm::vec2(0) : from_.uvs[index] * material.uv_scale + material.uv_offset);
    face_uvs_.push_back(index);
  }

  // A zero normal is replaced by the surface's own (mesh_file.cc).
  void AddNormal(std::int32_t index) {
    out_.mesh.corner_normals.push_back(index < 0 ? glm::vec3(0) : from_.normals[index]);
    face_normals_.push_back(index);
  }

  void AddWarnings() {
    if (!unknown_.empty())
      out_.Warn("no material library defines {}: white instead", ShortList(unknown_));
    if (corners_without_uv_) {
      out_.Warn("faces of a material with an image have no texture coordinates: {} instead",
                any_uv_ ? "its texel at (0, 0)" : "the material's colour");
    }
  }

  void AddTables() {
    if (any_uv_) out_.tables.uvs = std::move(from_.uvs);
    if (any_normal_) out_.tables.normals = std::move(from_.normals);
    out_.tables.corner_uvs = std::move(face_uvs_);
    out_.tables.corner_normals = std::move(face_normals_);
  }

  ObjStatements from_;
  const FileSource& source_;
  const std::string& name_;
  const bool any_uv_ = Any(1), any_normal_ = Any(2);
  LoadedMesh out_;
  std::map<std::int32_t, FaceMaterial> used_;  // by index of usemtl
  std::set<std::string, std::less<>> unknown_;
  bool corners_without_uv_ = false;
  std::vector<std::int32_t> face_uvs_, face_normals_;
  Polygon polygon_;  // scratch
};

// Not by "\n#": each line has the first of both.
bool HasColorComments(std::string_view text) {
  constexpr std::string_view kBegins = "#MRGB ";
  auto at = text.find(kBegins);
  while (at != std::string_view::npos && (at == 0 || text[at - 1] != '\n'))
    at = text.find(kBegins, at + 1);
  return at != std::string_view::npos;
}

}  // namespace

Result<LoadedMesh> ReadObj(const FileSource& source, const std::string& name) {
  TILEGRAD_ASSIGN(const Bytes file, source.Read(name));
  TILEGRAD_ASSIGN(ObjStatements statements, ParseObj(TextOf(file), source.Describe(name)));
  if (HasColorComments(TextOf(file)))
    statements.warnings.emplace_back("colours in comments (#MRGB, ZBrush's) are not read");
  return ObjAssembly(std::move(statements), source, name).Run();
}

}  // namespace tilegrad::io
