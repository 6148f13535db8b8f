// SPDX-License-Identifier: Apache-2.0
// Stanford PLY, text and binary of both byte orders. Not read by Assimp, whose reader reads past
// the end of a file with a wrong header or list.
#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <map>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "io/mesh_file.h"
#include "io/mesh_readers.h"
#include "io/ply_header.h"
#include "io/text_scan.h"

namespace tilegrad::io {
namespace {

bool IsPlyIndices(const PlyProperty& property) {
  return property.name == "vertex_indices" || property.name == "vertex_index";
}

// Ignores a position, a normal, a colour or a uv with missing components.
struct PlyColumns {
  // For faces (to kAlpha) and for vertices (from kRed).
  enum Slot { kTexNumber, kRed, kGreen, kBlue, kAlpha, kX, kY, kZ, kNx, kNy, kNz, kU, kV, kSlots };
  struct Column {
    Slot slot = kSlots;  // of a number that is read
    bool list = false;   // that is read
    double scale = 1;
  };

  // Reads the numbers from `first` up to `end`.
  PlyColumns(const PlyElement& element, Slot first, Slot end) {
    for (const PlyProperty& p : element.properties) {
      of.push_back(ColumnOf(p));
      const Slot slot = of.back().slot;
      if (slot >= first && slot < end) has[slot] = true;
    }
    NeedAll({kX, kY, kZ});
    NeedAll({kNx, kNy, kNz});
    NeedAll({kRed, kGreen, kBlue});
    NeedAll({kU, kV});
    has[kAlpha] = has[kAlpha] && has[kRed];
    for (Column& column : of) {
      if (column.slot != kSlots && !has[column.slot]) column.slot = kSlots;
    }
  }

  std::vector<Column> of;  // each property
  std::array<bool, kSlots> has{};

 private:
  static Column ColumnOf(const PlyProperty& p) {
    // Names used by exporters.
    static constexpr std::array<std::pair<std::string_view, Slot>, 27> kNames = {
        {{"x", kX},          {"y", kY},          {"z", kZ},
         {"nx", kNx},        {"ny", kNy},        {"nz", kNz},
         {"red", kRed},      {"green", kGreen},  {"blue", kBlue},
         {"r", kRed},        {"g", kGreen},      {"b", kBlue},
         {"alpha", kAlpha},  {"a", kAlpha},      {"diffuse_red", kRed},
         {"u", kU},          {"v", kV},          {"diffuse_green", kGreen},
         {"s", kU},          {"t", kV},          {"diffuse_blue", kBlue},
         {"texture_u", kU},  {"texture_v", kV},  {"diffuse_alpha", kAlpha},
         {"texcoord_u", kU}, {"texcoord_v", kV}, {"texnumber", kTexNumber}}};
    if (p.count_type) return {.list = IsPlyIndices(p) || p.name == "texcoord"};
    const auto* row = std::ranges::find(kNames, p.name, &std::pair<std::string_view, Slot>::first);
    if (row == kNames.end()) return {};
    // Integer colours range from 0 to the type's largest value.
    const bool color = row->second >= kRed && row->second <= kAlpha;
    const double scale = p.type == StoredType::kU8 ? 255 : p.type == StoredType::kU16 ? 65535 : 1;
    return {.slot = row->second, .scale = color ? scale : 1};
  }

  void NeedAll(std::initializer_list<Slot> slots) {
    const bool all = std::all_of(slots.begin(), slots.end(), [&](Slot s) { return has[s]; });
    for (const Slot slot : slots) has[slot] = all;
  }
};

// The numbers of the body in sequence, in any encoding.
class PlyValues {
 public:
  PlyValues(std::string_view data, PlyHeader::Encoding encoding)
      : rest_(data),
        text_(encoding == PlyHeader::Encoding::kText),
        swap_(encoding == PlyHeader::Encoding::kBigEndian) {}

  // False if the data ends or is no number; it need not be a finite one.
  bool Next(StoredType type, double& value) {
    if (text_) return ParseAnyNumber(NextToken(rest_), value);
    const std::size_t size = RowOf(type).size;
    if (rest_.size() < size) return false;
    std::array<char, 8> bytes;
    std::copy_n(rest_.begin(), size, bytes.begin());
    if (swap_) std::reverse(bytes.begin(), bytes.begin() + size);
    value = RowOf(type).load(bytes.data());
    rest_.remove_prefix(size);
    return true;
  }

  // A list of finite numbers. Checks its length against the data left before allocating.
  bool NextList(const PlyProperty& property, std::vector<double>& list) {
    std::size_t length = 0;
    if (!NextLength(property, length)) return false;
    list.resize(length);
    return std::ranges::all_of(
        list, [&](double& value) { return Next(property.type, value) && std::isfinite(value); });
  }

  // Skips a number or a list, whatever its contents. False if the data ends.
  bool Skip(const PlyProperty& property) {
    std::size_t count = 1;
    if (property.count_type && !NextLength(property, count)) return false;
    if (text_) {
      while (count > 0 && !NextToken(rest_).empty()) --count;
      return count == 0;
    }
    const std::size_t bytes = count * RowOf(property.type).size;
    if (rest_.size() < bytes) return false;
    rest_.remove_prefix(bytes);
    return true;
  }

 private:
  // The length of a list, checked against the data left.
  bool NextLength(const PlyProperty& property, std::size_t& length) {
    double value = 0;
    if (!Next(*property.count_type, value)) return false;
    const std::size_t least = text_ ? 1 : RowOf(property.type).size;
    if (!(value >= 0 && value <= static_cast<double>(rest_.size() / least))) return false;
    length = static_cast<std::size_t>(value);
    return true;
  }

  std::string_view rest_;
  bool text_, swap_;
};

struct PlyFace {
  std::size_t first = 0, count = 0;  // among the corners of all faces
  glm::vec4 color;
  double image = -1;  // index of its texture
};

// Converts what follows the header: vertices, faces and triangle strips become a mesh without
// materials.
class PlyBody {
 public:
  PlyBody(const PlyHeader& header, const std::string& place, LoadedMesh& out)
      : header_(header), place_(place), values_(header.data, header.encoding), out_(out) {}

  Status Read() {
    for (const PlyElement& element : header_.elements) {
      if (element.name == "vertex")
        TILEGRAD_TRY(Vertices(element));
      else if (element.name == "face")
        TILEGRAD_TRY(Faces(element));
      else if (element.name == "tristrips")
        TILEGRAD_TRY(Strips(element));
      else
        TILEGRAD_TRY(Skip(element));
    }
    AddFaces();
    AddWarnings();
    return {};
  }

  // The header's image that each triangle refers to, from 0; empty if no face refers to one.
  const std::vector<double>& images() const { return images_; }

 private:
  using enum PlyColumns::Slot;

  Status Error(const PlyElement& element, std::size_t row, const PlyProperty& property) const {
    return DataLoss("{}: {} {}: \"{}\" is cut off or not a finite number", place_, element.name,
                    row, property.name);
  }

  // Warns of ignored properties.
  PlyColumns ColumnsOf(const PlyElement& element, PlyColumns::Slot first, PlyColumns::Slot end) {
    PlyColumns columns(element, first, end);
    for (std::size_t k = 0; k < columns.of.size() && element.count > 0; ++k) {
      if (columns.of[k].slot == kSlots && !columns.of[k].list)
        properties_not_read_.insert(element.properties[k].name);
    }
    return columns;
  }

  // Normals need not be finite: DropNonFiniteNormals comes later.
  bool ReadNumber(const PlyProperty& property, const PlyColumns::Column& column, double& to) {
    if (!values_.Next(property.type, to)) return false;
    to /= column.scale;
    return std::isfinite(to) || (column.slot >= kNx && column.slot <= kNz);
  }

  // Reads the next row: numbers into `row` by slot, lists to `take` with their property.
  template <class Take>
  Status ReadRow(const PlyElement& element, std::size_t i, const PlyColumns& columns,
                 std::array<double, kSlots>& row, Take take) {
    for (std::size_t k = 0; k < columns.of.size(); ++k) {
      const PlyProperty& property = element.properties[k];
      const PlyColumns::Column& column = columns.of[k];
      const bool good = column.list ? values_.NextList(property, list_)
                        : column.slot == PlyColumns::kSlots
                            ? values_.Skip(property)
                            : ReadNumber(property, column, row[column.slot]);
      if (!good) return Error(element, i, property);
      if (column.list) TILEGRAD_TRY(take(property));
    }
    return {};
  }

  Status Vertices(const PlyElement& element) {
    Mesh& mesh = out_.mesh;
    const PlyColumns columns = ColumnsOf(element, kRed, kSlots);
    const auto& has = columns.has;
    if (!has[kX]) return DataLoss("{}: the vertices have no x, y and z", place_);
    std::array<double, kSlots> row{};
    row[kAlpha] = 1;
    for (std::size_t i = 0; i < element.count; ++i) {
      TILEGRAD_TRY(ReadRow(element, i, columns, row, [](const PlyProperty&) { return Status(); }));
      out_.exact.emplace_back(row[kX], row[kY], row[kZ]);
      if (has[kNx]) mesh.normals.emplace_back(row[kNx], row[kNy], row[kNz]);
      if (has[kRed]) mesh.colors.emplace_back(row[kRed], row[kGreen], row[kBlue], row[kAlpha]);
      if (has[kU]) vertex_uvs_.emplace_back(row[kU], row[kV]);
    }
    return {};
  }

  // Keeps them until all vertices are read: elements may come in any order.
  Status Faces(const PlyElement& element) {
    const PlyColumns columns = ColumnsOf(element, kTexNumber, kX);
    const auto& has = columns.has;
    has_images_ = has_images_ || has[kTexNumber];
    has_face_colors_ = has_face_colors_ || has[kRed];
    std::array<double, kSlots> row{};
    row[kAlpha] = 1;
    std::vector<double> uvs;
    for (std::size_t i = 0; i < element.count; ++i) {
      PlyFace face{corners_.size(), 0, kNoColor, -1};
      uvs.clear();
      TILEGRAD_TRY(ReadRow(element, i, columns, row, [&](const PlyProperty& property) {
        if (property.name == "texcoord") uvs = list_;
        if (IsPlyIndices(property)) return AddCorners(element, i);
        return Status();
      }));
      face.count = corners_.size() - face.first;
      if (has[kRed]) face.color = {row[kRed], row[kGreen], row[kBlue], row[kAlpha]};
      if (has[kTexNumber]) face.image = row[kTexNumber];
      AddCornerUvs(uvs, face);
      faces_.push_back(face);
    }
    return {};
  }

  // The corners in list_.
  Status AddCorners(const PlyElement& element, std::size_t row) {
    for (const double index : list_) {
      TILEGRAD_TRY(CheckIndex(element, row, index));
      corners_.push_back(static_cast<std::int32_t>(index));
    }
    return {};
  }

  Status CheckIndex(const PlyElement& element, std::size_t row, double index) const {
    const std::size_t vertices = header_.CountOf("vertex");
    if (index >= 0 && index < static_cast<double>(vertices) && index == std::floor(index))
      return {};
    return DataLoss("{}: {} {} uses vertex {}, but the file has {}", place_, element.name, row,
                    index, vertices);
  }

  // "texcoord": u and v of every corner of the polygon, in its order; 0 for a face without them.
  void AddCornerUvs(const std::vector<double>& uvs, const PlyFace& face) {
    if (uvs.empty()) return;
    if (uvs.size() != 2 * face.count) {
      odd_uvs_ = true;
      return;
    }
    uvs_.resize(face.first, glm::vec2(0));
    for (std::size_t k = 0; k < face.count; ++k) uvs_.emplace_back(uvs[2 * k], uvs[2 * k + 1]);
  }

  // Triangle strips, concatenated, with -1 between them.
  Status Strips(const PlyElement& element) {
    const PlyColumns columns = ColumnsOf(element, kSlots, kSlots);
    std::array<double, kSlots> row{};
    for (std::size_t i = 0; i < element.count; ++i) {
      TILEGRAD_TRY(ReadRow(element, i, columns, row, [&](const PlyProperty& property) {
        return IsPlyIndices(property) ? AddStrips(element, i) : Status();
      }));
    }
    return {};
  }

  Status AddStrips(const PlyElement& element, std::size_t row) {
    std::size_t length = 0;
    std::array<std::int32_t, 3> last{};
    for (const double index : list_) {
      if (index == -1) {
        length = 0;
        continue;
      }
      TILEGRAD_TRY(CheckIndex(element, row, index));
      last = {last[1], last[2], static_cast<std::int32_t>(index)};
      const auto [a, b, c] = last;
      if (++length < 3 || a == b || b == c || c == a) continue;  // repeated to turn a corner
      strip_faces_.push_back(length % 2 == 1 ? Face{a, b, c} : Face{b, a, c});
    }
    return {};
  }

  void AddFace(const PlyFace& face) {
    Mesh& mesh = out_.mesh;
    const std::span<const std::int32_t> corners(corners_.data() + face.first, face.count);
    polygon_.corners.assign(corners.begin(), corners.end());
    polygon_.AddTo(out_);
    for (const Face& triangle : polygon_.triangles) {
      if (has_images_) images_.push_back(face.image);
      for (const std::int32_t k : triangle) {
        if (!uvs_.empty())
          mesh.corner_uvs.push_back(uvs_[face.first + static_cast<std::size_t>(k)]);
        if (has_face_colors_) mesh.corner_colors.push_back(face.color);
      }
    }
  }

  void AddFaces() {
    Mesh& mesh = out_.mesh;
    uvs_.resize(uvs_.empty() ? 0 : corners_.size(), glm::vec2(0));
    for (const PlyFace& face : faces_) AddFace(face);
    mesh.faces.insert(mesh.faces.end(), strip_faces_.begin(), strip_faces_.end());
    const std::size_t corners = 3 * mesh.faces.size();
    if (!mesh.corner_uvs.empty()) mesh.corner_uvs.resize(corners, glm::vec2(0));
    if (!mesh.corner_colors.empty()) mesh.corner_colors.resize(corners, kNoColor);
    if (!images_.empty()) images_.resize(mesh.faces.size(), -1);
    if (!mesh.corner_uvs.empty() || vertex_uvs_.empty()) return;
    for (const Face& face : mesh.faces) {
      for (const std::int32_t v : face) mesh.corner_uvs.push_back(vertex_uvs_[v]);
    }
  }

  void AddWarnings() {
    if (!out_.mesh.colors.empty() && !out_.mesh.corner_colors.empty()) {
      out_.mesh.corner_colors.clear();
      out_.Warn("colours of faces left out: the vertices have their own");
    }
    if (!uvs_.empty() && !vertex_uvs_.empty())
      out_.Warn("texture coordinates of vertices left out: the faces have their own");
    if (odd_uvs_)
      out_.Warn("texture coordinates of faces left out where there are not two for each corner");
    for (const auto& [what, names] :
         {std::pair("elements", &not_read_), std::pair("properties", &properties_not_read_)}) {
      if (!names->empty()) out_.Warn("{} left out: {}", what, ShortList(*names));
    }
  }

  Status Skip(const PlyElement& element) {
    if (element.count > 0) not_read_.insert(element.name);
    for (std::size_t i = 0; i < element.count; ++i) {
      for (const PlyProperty& property : element.properties) {
        if (!values_.Skip(property)) return Error(element, i, property);
      }
    }
    return {};
  }

  const PlyHeader& header_;
  const std::string& place_;
  PlyValues values_;
  LoadedMesh& out_;
  std::vector<glm::vec2> vertex_uvs_, uvs_;  // uvs_: of corners_, if any face has them
  std::vector<std::int32_t> corners_;        // of faces_
  std::vector<PlyFace> faces_;
  std::vector<Face> strip_faces_;
  std::vector<double> images_;
  bool has_images_ = false, has_face_colors_ = false, odd_uvs_ = false;
  std::set<std::string, std::less<>> not_read_, properties_not_read_;
  std::vector<double> list_;  // scratch: the last list
  Polygon polygon_;           // scratch: the last polygon
};

// A material for each image that faces refer to by number, and a white one.
class PlyTextures {
 public:
  PlyTextures(const PlyHeader& header, const FileSource& source, const std::string& name,
              LoadedMesh& out)
      : header_(header), source_(source), name_(name), out_(out) {}

  void Add(const std::vector<double>& images) {
    const std::size_t count = header_.textures.size();
    if (count == 0) return;
    if (out_.mesh.corner_uvs.empty()) {
      out_.Warn("textures left out: the file has no texture coordinates");
      return;
    }
    if (images.empty()) {
      MaterialOf(0);
      if (count > 1) out_.Warn("textures but the first left out: faces have no texnumber");
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
      out_.Warn("a face has texnumber {}, but the file has {} textures", image,
                header_.textures.size());
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
  PlyBody body(header, place, out);
  TILEGRAD_TRY(body.Read());
  PlyTextures(header, source, name, out).Add(body.images());
  return out;
}

}  // namespace tilegrad::io
