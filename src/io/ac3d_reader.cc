// SPDX-License-Identifier: Apache-2.0
// AC3D text (.ac), as FlightGear's models use it, and its dialect of TORCS (.acc), which has strips
// of triangles, normals behind vertices, several layers of texture, of which the base is read, and
// a uv for each layer behind a corner, of which the first is read. Not read by Assimp, whose reader
// exhausts memory, overflows the stack or leaves array bounds on wrong counts. Surfaces keep the
// order of their corners; crease angles and subdivision are ignored.
#include <algorithm>
#include <glm/mat4x4.hpp>
#include <map>

#include "base/error.h"
#include "io/mesh_readers.h"
#include "io/text_scan.h"

namespace tilegrad::io {
namespace {

constexpr int kMaxDepth = 256;                // objects are read recursively
constexpr unsigned kPolygon = 0, kStrip = 4;  // the low four bits of a surface's flags

// The next token, or a quoted string, which may contain spaces.
std::string_view NextAc3dString(std::string_view& rest) {
  const auto begin = rest.find_first_not_of(" \t");
  if (begin == std::string_view::npos || rest[begin] != '"') return NextToken(rest);
  const auto end = std::min(rest.find('"', begin + 1), rest.size());
  const auto text = rest.substr(begin + 1, end - begin - 1);
  rest.remove_prefix(std::min(end + 1, rest.size()));
  return text;
}

// Lines and numbers of the text, and its materials.
class Ac3dText : public Lines {
 public:
  using Lines::Lines;

  bool NextRaw(std::string_view& line) { return Lines::Next(line); }
  // The next line that is not empty.
  bool Next(std::string_view& line) {
    while (NextRaw(line)) {
      if (!Trimmed(line).empty()) return true;
    }
    return false;
  }

  // Takes `count` finite numbers off `rest`; errors call them `what`.
  template <class T>
  Status Numbers(std::string_view& rest, T* values, int count, const char* what) const {
    for (int i = 0; i < count; ++i) {
      if (!ParseNumber(NextToken(rest), values[i]))
        return Error("{} needs {} finite number{}", what, count, count > 1 ? "s" : "");
    }
    return {};
  }

  // Reads what follows MATERIAL on its line, or, in version 12 of the format, MAT: one property per
  // line, up to ENDMAT.
  Result<Material> ReadMaterial(std::string_view rest, bool block) {
    Material material{.name = std::string(NextAc3dString(rest)), .base_color = glm::vec4(1)};
    while (block) {
      if (!Next(rest)) return Error("ends before ENDMAT");
      if (rest.starts_with("ENDMAT")) return material;
      TILEGRAD_TRY(MaterialValues(rest, material));
    }
    TILEGRAD_TRY(MaterialValues(rest, material));
    return material;
  }
  // Whether any of these is emissive.
  bool emits() const { return emits_; }

 private:
  // "rgb 1 1 1  amb ...  trans 0", or a part of it.
  Status MaterialValues(std::string_view rest, Material& material) {
    for (auto key = NextToken(rest); !key.empty(); key = NextToken(rest)) {
      if (key == "rgb") TILEGRAD_TRY(Numbers(rest, &material.base_color[0], 3, "rgb"));
      if (key == "emis") {
        glm::vec3 light(0);
        TILEGRAD_TRY(Numbers(rest, &light[0], 3, "emis"));
        emits_ = emits_ || light != glm::vec3(0);
      }
      if (key != "trans") continue;
      float transparency = 0;
      TILEGRAD_TRY(Numbers(rest, &transparency, 1, "trans"));
      material.base_color.a = 1 - transparency;
    }
    return {};
  }

  bool emits_ = false;
};

// Properties that children inherit from an object.
struct Inherited {
  glm::dmat4 transform = glm::dmat4(1);
  std::string texture;
};

struct Object {
  std::string name;
  Inherited inherited;
  glm::dmat4 local = glm::dmat4(1);
  glm::vec2 uv_repeat = glm::vec2(1), uv_offset = glm::vec2(0);
  std::size_t first_vertex = 0, vertices = 0;  // in the whole mesh
};

class Ac3dReader {
 public:
  Ac3dReader(const FileSource& source, const std::string& name, std::string_view text)
      : source_(source), name_(name), text_(text, source.Describe(name)) {}

  Status Read() {
    std::string_view line;
    if (!text_.NextRaw(line) || !line.starts_with("AC3D"))
      return DataLoss("{}: does not begin with \"AC3D\"", text_.place());
    while (text_.Next(line)) {
      const auto keyword = NextToken(line);
      if (keyword == "OBJECT") {
        TILEGRAD_TRY(ReadObject({}, 0));
        continue;
      }
      if (keyword != "MATERIAL" && keyword != "MAT")
        return text_.Error("expected MATERIAL or OBJECT");
      TILEGRAD_ASSIGN(Material material, text_.ReadMaterial(line, /*block=*/keyword == "MAT"));
      palette_.push_back(std::move(material));
    }
    if (text_.emits()) out.warnings.emplace_back("the emission of materials is not drawn");
    return {};
  }

  LoadedMesh out;

 private:
  // The lines after OBJECT up to its children, which end it.
  Status ReadObject(const Inherited& parent, int depth) {
    if (depth > kMaxDepth) return text_.Error("objects nested more than {} deep", kMaxDepth);
    Object object;
    object.inherited = parent;
    for (std::string_view line; text_.Next(line);) {
      const auto keyword = NextToken(line);
      if (keyword == "kids") return ReadKids(line, object, depth);
      TILEGRAD_TRY(ReadProperty(keyword, line, object));
    }
    return text_.Error("ends within an object, before its \"kids\"");
  }

  Status ReadProperty(std::string_view keyword, std::string_view rest, Object& object) {
    if (keyword == "name") object.name = NextAc3dString(rest);
    if (keyword == "texture") ReadTexture(rest, object);
    if (keyword == "texrep") return text_.Numbers(rest, &object.uv_repeat[0], 2, "texrep");
    if (keyword == "texoff") return text_.Numbers(rest, &object.uv_offset[0], 2, "texoff");
    if (keyword == "loc") return text_.Numbers(rest, &object.local[3][0], 3, "loc");
    if (keyword == "rot") return ReadRotation(rest, object);
    if (keyword == "data") return SkipData(rest);
    if (keyword == "numvert") return ReadVertices(rest, object);
    if (keyword == "numsurf") return ReadSurfaces(rest, object);
    return {};  // crease, subdiv, url, hidden, locked, folded, ...
  }

  // The name, and in .acc the layer: base, tiled, skids, shad.
  static void ReadTexture(std::string_view rest, Object& object) {
    const auto file = NextAc3dString(rest), layer = NextToken(rest);
    if (layer.empty() || layer == "base") object.inherited.texture = file;
  }

  // Row-major.
  Status ReadRotation(std::string_view rest, Object& object) {
    double r[9];
    TILEGRAD_TRY(text_.Numbers(rest, r, 9, "rot"));
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) object.local[column][row] = r[3 * row + column];
    }
    return {};
  }

  // "data N" is followed by N characters of any kind.
  Status SkipData(std::string_view rest) {
    std::size_t size = 0;
    TILEGRAD_TRY(text_.Numbers(rest, &size, 1, "data"));
    std::size_t done = 0;
    for (std::string_view line; done < size && text_.NextRaw(line);) done += line.size() + 1;
    return {};
  }

  Status ReadVertices(std::string_view rest, Object& object) {
    TILEGRAD_TRY(text_.Numbers(rest, &object.vertices, 1, "numvert"));
    object.first_vertex = out.exact.size();
    const glm::dmat4 m = object.inherited.transform * object.local;
    for (std::size_t i = 0; i < object.vertices; ++i) {
      std::string_view line;
      if (!text_.Next(line)) return text_.Error("ends at vertex {} of {}", i, object.vertices);
      glm::dvec4 p(0, 0, 0, 1);
      TILEGRAD_TRY(text_.Numbers(line, &p[0], 3, "a vertex"));
      out.exact.emplace_back(m * p);
    }
    return {};
  }

  Status ReadSurfaces(std::string_view rest, Object& object) {
    std::size_t count = 0;
    TILEGRAD_TRY(text_.Numbers(rest, &count, 1, "numsurf"));
    out.parts.push_back({object.name, out.mesh.faces.size()});
    for (std::size_t i = 0; i < count; ++i) {
      std::string_view line;
      if (!text_.Next(line) || NextToken(line) != "SURF") return text_.Error("expected SURF");
      auto flags = NextToken(line);
      if (flags.starts_with("0x") || flags.starts_with("0X")) flags.remove_prefix(2);
      unsigned bits = 0;
      if (std::from_chars(flags.data(), flags.data() + flags.size(), bits, 16).ec != std::errc())
        return text_.Error("SURF needs a hexadecimal number");
      TILEGRAD_TRY(ReadSurface(object, bits));
    }
    return {};
  }

  Status ReadSurface(const Object& object, unsigned flags) {
    std::size_t palette = 0, refs = 0;
    std::string_view line;
    for (bool last = false; !last;) {
      if (!text_.Next(line)) return text_.Error("ends within a surface");
      const auto keyword = NextToken(line);
      last = keyword == "refs";
      if (keyword == "mat") TILEGRAD_TRY(text_.Numbers(line, &palette, 1, "mat"));
      if (last) TILEGRAD_TRY(text_.Numbers(line, &refs, 1, "refs"));
      if (keyword != "mat" && !last) return text_.Error("expected mat or refs");
    }
    if (palette > 0 && palette >= palette_.size())
      return text_.Error("material {}, but the file has {}", palette, palette_.size());
    TILEGRAD_TRY(ReadCorners(object, refs));
    switch (flags & 0xf) {
      case kPolygon:
        polygon_.AddTo(out);
        break;
      case kStrip:
        AddStrip();
        break;
      default:
        polygon_.triangles.clear();
        if (!std::exchange(lines_warned_, true)) out.Warn("surfaces that are lines left out");
    }
    FinishTriangles(static_cast<int>(palette), object);
    return {};
  }

  // One "INDEX U V" per line.
  Status ReadCorners(const Object& object, std::size_t count) {
    polygon_.corners.clear();
    uvs_.clear();
    for (std::size_t i = 0; i < count; ++i) {
      std::string_view line;
      if (!text_.Next(line)) return text_.Error("ends at corner {} of {}", i, count);
      std::size_t index = 0;
      TILEGRAD_TRY(text_.Numbers(line, &index, 1, "a corner's vertex"));
      if (index >= object.vertices)
        return text_.Error("vertex {}, but the object has {}", index, object.vertices);
      glm::vec2 uv(0);
      TILEGRAD_TRY(text_.Numbers(line, &uv[0], 2, "a corner's uv"));
      polygon_.corners.push_back(static_cast<std::int32_t>(object.first_vertex + index));
      uvs_.push_back(object.uv_offset + uv * object.uv_repeat);
    }
    return {};
  }

  // Flips every other triangle, so that all keep the first one's side. Triangles that repeat a
  // corner only join strips.
  void AddStrip() {
    const std::vector<std::int32_t>& v = polygon_.corners;
    polygon_.triangles.clear();
    for (std::int32_t i = 0; i + 2 < static_cast<std::int32_t>(v.size()); ++i) {
      const Face corner = {i, i + 1 + i % 2, i + 2 - i % 2};
      const Face face = {v[corner[0]], v[corner[1]], v[corner[2]]};
      if (face[0] == face[1] || face[1] == face[2] || face[0] == face[2]) continue;
      polygon_.triangles.push_back(corner);
      out.mesh.faces.push_back(face);
    }
  }

  // Material and uv of the triangles added by a surface.
  void FinishTriangles(int palette, const Object& object) {
    if (polygon_.triangles.empty()) return;
    const std::int32_t material = MaterialOf(palette, object.inherited.texture);
    for (const Face& triangle : polygon_.triangles) {
      out.mesh.face_materials.push_back(material);
      for (const std::int32_t k : triangle) out.mesh.corner_uvs.push_back(uvs_[k]);
    }
  }

  // The texture is a property of objects in the file, and of materials here.
  std::int32_t MaterialOf(int palette, const std::string& texture) {
    const auto [it, added] = materials_.try_emplace(
        {palette, texture}, static_cast<std::int32_t>(out.mesh.materials.size()));
    if (added) {
      Material material =
          palette_.empty() ? Material{} : palette_[static_cast<std::size_t>(palette)];
      if (!texture.empty()) material.base_color_texture = AddTexture(source_, name_, texture, out);
      out.mesh.materials.push_back(std::move(material));
    }
    return it->second;
  }

  Status ReadKids(std::string_view rest, Object& object, int depth) {
    std::size_t count = 0;
    TILEGRAD_TRY(text_.Numbers(rest, &count, 1, "kids"));
    object.inherited.transform *= object.local;
    for (std::size_t i = 0; i < count; ++i) {
      std::string_view line;
      const bool more = text_.Next(line);
      if (!more && i > 0) return NoteMissing(i, count);
      if (!more || NextToken(line) != "OBJECT")
        return text_.Error("expected OBJECT, child {} of {}", i, count);
      TILEGRAD_TRY(ReadObject(object.inherited, depth + 1));
    }
    return {};
  }

  // When people delete objects by hand, the count in their group stays as it was.
  Status NoteMissing(std::size_t child, std::size_t count) {
    if (!std::exchange(missing_warned_, true))
      out.Warn("the file ends before child {} of {} of a group", child, count);
    return {};
  }

  const FileSource& source_;
  const std::string& name_;
  Ac3dText text_;
  std::vector<Material> palette_;
  std::map<std::pair<int, std::string>, std::int32_t> materials_;
  Polygon polygon_;             // scratch: the last surface
  std::vector<glm::vec2> uvs_;  // scratch: of its corners
  bool lines_warned_ = false, missing_warned_ = false;
};

}  // namespace

Result<LoadedMesh> ReadAc3d(const FileSource& source, const std::string& name) {
  TILEGRAD_ASSIGN(const Bytes bytes, source.Read(name));
  Ac3dReader reader(source, name, TextOf(bytes));
  TILEGRAD_TRY(reader.Read());
  return std::move(reader.out);
}

}  // namespace tilegrad::io
