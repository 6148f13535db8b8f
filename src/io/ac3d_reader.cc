// SPDX-License-Identifier: Apache-2.0
// AC3D text (.ac), as FlightGear's models use it. Not read by Assimp, whose reader exhausts memory,
// overflows the stack or leaves array bounds on wrong counts. Surfaces keep the order of their
// corners; crease angles and subdivision are ignored.
#include <glm/mat4x4.hpp>
#include <map>

#include "base/error.h"
#include "io/mesh_readers.h"
#include "io/text_scan.h"

namespace tilegrad::io {
namespace {

constexpr int kMaxDepth = 256;  // objects are read recursively

// The next token, or a quoted string, which may contain spaces.
std::string_view NextString(std::string_view& rest) {
  const auto begin = rest.find_first_not_of(" \t");
  if (begin == std::string_view::npos || rest[begin] != '"') return NextToken(rest);
  const auto end = std::min(rest.find('"', begin + 1), rest.size());
  const auto text = rest.substr(begin + 1, end - begin - 1);
  rest.remove_prefix(std::min(end + 1, rest.size()));
  return text;
}

// What an object hands to its children.
struct Inherited {
  glm::dmat4 transform = glm::dmat4(1);
  std::string texture;
};

struct Object {
  Inherited inherited;
  glm::dmat4 local = glm::dmat4(1);
  glm::vec2 uv_repeat = glm::vec2(1), uv_offset = glm::vec2(0);
  std::size_t first_vertex = 0, vertices = 0;  // in the whole mesh
};

class Ac3dReader {
 public:
  Ac3dReader(const FileSource& source, const std::string& name, std::string_view text)
      : source_(source), name_(name), place_(source.Describe(name)), lines_(text) {}

  Status Read() {
    std::string_view line;
    if (!lines_.Next(line) || !line.starts_with("AC3D"))
      return DataLoss("{}: does not begin with \"AC3D\"", place_);
    while (Next(line)) {
      const auto keyword = NextToken(line);
      if (keyword == "MATERIAL")
        TILEGRAD_TRY(ReadMaterial(line));
      else if (keyword == "MAT")
        TILEGRAD_TRY(ReadMaterialBlock(line));
      else if (keyword == "OBJECT")
        TILEGRAD_TRY(ReadObject({}, 0));
      else
        return Error("expected MATERIAL or OBJECT");
    }
    return {};
  }

  LoadedMesh out;

 private:
  // The next line that is not empty.
  bool Next(std::string_view& line) {
    while (lines_.Next(line)) {
      if (line.find_first_not_of(" \t\r") != std::string_view::npos) return true;
    }
    return false;
  }

  Status Error(const std::string& what) const {
    return DataLoss("{}: line {}: {}", place_, lines_.Number(), what);
  }

  template <class T>
  Status Numbers(std::string_view& rest, T* values, int count, const char* what) {
    for (int i = 0; i < count; ++i) {
      if (!ParseNumber(NextToken(rest), values[i]))
        return Error(fmt::format("{} needs {} finite number{}", what, count, count > 1 ? "s" : ""));
    }
    return {};
  }

  // "rgb 1 1 1  amb ...  trans 0", or a part of it.
  Status MaterialValues(std::string_view rest, Material& material) {
    for (auto key = NextToken(rest); !key.empty(); key = NextToken(rest)) {
      if (key == "rgb") TILEGRAD_TRY(Numbers(rest, &material.base_color[0], 3, "rgb"));
      if (key != "trans") continue;
      float transparency = 0;
      TILEGRAD_TRY(Numbers(rest, &transparency, 1, "trans"));
      material.base_color.a = 1 - transparency;
    }
    return {};
  }

  Status ReadMaterial(std::string_view rest) {
    Material material{.name = std::string(NextString(rest)), .base_color = glm::vec4(1)};
    TILEGRAD_TRY(MaterialValues(rest, material));
    palette_.push_back(std::move(material));
    return {};
  }

  // Version 12 of the format: one line a property, up to ENDMAT.
  Status ReadMaterialBlock(std::string_view rest) {
    Material material{.name = std::string(NextString(rest)), .base_color = glm::vec4(1)};
    for (std::string_view line; Next(line);) {
      if (line.starts_with("ENDMAT")) {
        palette_.push_back(std::move(material));
        return {};
      }
      TILEGRAD_TRY(MaterialValues(line, material));
    }
    return Error("ends before ENDMAT");
  }

  // The lines after OBJECT up to its children, which end it.
  Status ReadObject(const Inherited& parent, int depth) {
    if (depth > kMaxDepth) return Error(fmt::format("objects nested more than {} deep", kMaxDepth));
    Object object;
    object.inherited = parent;
    for (std::string_view line; Next(line);) {
      const auto keyword = NextToken(line);
      if (keyword == "kids") return ReadKids(line, object, depth);
      TILEGRAD_TRY(ReadProperty(keyword, line, object));
    }
    return Error("ends within an object, before its \"kids\"");
  }

  Status ReadProperty(std::string_view keyword, std::string_view rest, Object& object) {
    if (keyword == "texture") object.inherited.texture = NextString(rest);
    if (keyword == "texrep") return Numbers(rest, &object.uv_repeat[0], 2, "texrep");
    if (keyword == "texoff") return Numbers(rest, &object.uv_offset[0], 2, "texoff");
    if (keyword == "loc") return Numbers(rest, &object.local[3][0], 3, "loc");
    if (keyword == "rot") return ReadRotation(rest, object);
    if (keyword == "data") return SkipData(rest);
    if (keyword == "numvert") return ReadVertices(rest, object);
    if (keyword == "numsurf") return ReadSurfaces(rest, object);
    return {};  // name, crease, subdiv, url, hidden, locked, folded, ...
  }

  // Row-major.
  Status ReadRotation(std::string_view rest, Object& object) {
    double r[9];
    TILEGRAD_TRY(Numbers(rest, r, 9, "rot"));
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) object.local[column][row] = r[3 * row + column];
    }
    return {};
  }

  // "data N" is followed by N characters of any kind.
  Status SkipData(std::string_view rest) {
    std::size_t size = 0;
    TILEGRAD_TRY(Numbers(rest, &size, 1, "data"));
    std::size_t done = 0;
    for (std::string_view line; done < size && lines_.Next(line);) done += line.size() + 1;
    return {};
  }

  Status ReadVertices(std::string_view rest, Object& object) {
    TILEGRAD_TRY(Numbers(rest, &object.vertices, 1, "numvert"));
    object.first_vertex = out.exact.size();
    const glm::dmat4 m = object.inherited.transform * object.local;
    for (std::size_t i = 0; i < object.vertices; ++i) {
      std::string_view line;
      if (!Next(line)) return Error(fmt::format("ends at vertex {} of {}", i, object.vertices));
      glm::dvec4 p(0, 0, 0, 1);
      TILEGRAD_TRY(Numbers(line, &p[0], 3, "a vertex"));
      out.exact.emplace_back(m * p);
    }
    return {};
  }

  Status ReadSurfaces(std::string_view rest, Object& object) {
    std::size_t count = 0;
    TILEGRAD_TRY(Numbers(rest, &count, 1, "numsurf"));
    for (std::size_t i = 0; i < count; ++i) {
      std::string_view line;
      if (!Next(line) || NextToken(line) != "SURF") return Error("expected SURF");
      auto flags = NextToken(line);
      if (flags.starts_with("0x") || flags.starts_with("0X")) flags.remove_prefix(2);
      unsigned bits = 0;
      if (std::from_chars(flags.data(), flags.data() + flags.size(), bits, 16).ec != std::errc())
        return Error("SURF needs a hexadecimal number");
      TILEGRAD_TRY(ReadSurface(object, bits));
    }
    return {};
  }

  Status ReadSurface(const Object& object, unsigned flags) {
    std::size_t palette = 0, refs = 0;
    std::string_view line;
    for (bool last = false; !last;) {
      if (!Next(line)) return Error("ends within a surface");
      const auto keyword = NextToken(line);
      last = keyword == "refs";
      if (keyword == "mat") TILEGRAD_TRY(Numbers(line, &palette, 1, "mat"));
      if (last) TILEGRAD_TRY(Numbers(line, &refs, 1, "refs"));
      if (keyword != "mat" && !last) return Error("expected mat or refs");
    }
    if (palette > 0 && palette >= palette_.size())
      return Error(fmt::format("material {}, but the file has {}", palette, palette_.size()));
    TILEGRAD_TRY(ReadCorners(object, refs));
    constexpr unsigned kTypeMask = 0xf;
    if ((flags & kTypeMask) == 0)
      AddPolygon(static_cast<int>(palette), object);
    else if (!std::exchange(lines_warned_, true))
      out.warnings.push_back("surfaces that are lines left out");
    return {};
  }

  // "INDEX U V" a line.
  Status ReadCorners(const Object& object, std::size_t count) {
    polygon_.corners.clear();
    uvs_.clear();
    for (std::size_t i = 0; i < count; ++i) {
      std::string_view line;
      if (!Next(line)) return Error(fmt::format("ends at corner {} of {}", i, count));
      std::size_t index = 0;
      TILEGRAD_TRY(Numbers(line, &index, 1, "a corner's vertex"));
      if (index >= object.vertices)
        return Error(fmt::format("vertex {}, but the object has {}", index, object.vertices));
      glm::vec2 uv(0);
      TILEGRAD_TRY(Numbers(line, &uv[0], 2, "a corner's uv"));
      polygon_.corners.push_back(static_cast<std::int32_t>(object.first_vertex + index));
      uvs_.push_back(object.uv_offset + uv * object.uv_repeat);
    }
    return {};
  }

  void AddPolygon(int palette, const Object& object) {
    polygon_.AddTo(out);
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
    TILEGRAD_TRY(Numbers(rest, &count, 1, "kids"));
    object.inherited.transform *= object.local;
    for (std::size_t i = 0; i < count; ++i) {
      std::string_view line;
      if (!Next(line) || NextToken(line) != "OBJECT")
        return Error(fmt::format("expected OBJECT, child {} of {}", i, count));
      TILEGRAD_TRY(ReadObject(object.inherited, depth + 1));
    }
    return {};
  }

  const FileSource& source_;
  const std::string& name_;
  const std::string place_;
  Lines lines_;
  std::vector<Material> palette_;
  std::map<std::pair<int, std::string>, std::int32_t> materials_;
  Polygon polygon_;             // scratch: the last surface
  std::vector<glm::vec2> uvs_;  // scratch: of its corners
  bool lines_warned_ = false;
};

}  // namespace

Result<LoadedMesh> ReadAc3d(const FileSource& source, const std::string& name) {
  TILEGRAD_ASSIGN(const Bytes bytes, source.Read(name));
  Ac3dReader reader(source, name, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  TILEGRAD_TRY(reader.Read());
  return std::move(reader.out);
}

}  // namespace tilegrad::io
