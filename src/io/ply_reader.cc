// SPDX-License-Identifier: Apache-2.0
// Stanford PLY, text and binary of both byte orders. Not read by Assimp, whose reader reads past
// the end of a file with a wrong header or list.
#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "base/error.h"
#include "io/mesh_readers.h"
#include "io/ply_header.h"
#include "io/text_scan.h"

namespace tilegrad::io {
namespace {

template <class T>
double Decode(const char* bytes, bool swap) {
  std::array<char, sizeof(T)> copy;
  std::memcpy(copy.data(), bytes, sizeof(T));
  if (swap) std::reverse(copy.begin(), copy.end());
  return static_cast<double>(std::bit_cast<T>(copy));
}

double DecodeAs(PlyType type, const char* bytes, bool swap) {
  switch (type) {
    case PlyType::kI8:
      return Decode<std::int8_t>(bytes, swap);
    case PlyType::kU8:
      return Decode<std::uint8_t>(bytes, swap);
    case PlyType::kI16:
      return Decode<std::int16_t>(bytes, swap);
    case PlyType::kU16:
      return Decode<std::uint16_t>(bytes, swap);
    case PlyType::kI32:
      return Decode<std::int32_t>(bytes, swap);
    case PlyType::kU32:
      return Decode<std::uint32_t>(bytes, swap);
    case PlyType::kF32:
      return Decode<float>(bytes, swap);
    case PlyType::kF64:
      return Decode<double>(bytes, swap);
  }
  return 0;
}

// The numbers of the body one after the other, however they are written.
class Values {
 public:
  Values(std::string_view data, PlyHeader::Encoding encoding)
      : rest_(data),
        text_(encoding == PlyHeader::Encoding::kText),
        swap_(encoding == PlyHeader::Encoding::kBigEndian) {}

  // False if the data ends or is not a finite number.
  bool Next(PlyType type, double& value) {
    if (text_) return ParseNumber(NextToken(rest_), value);
    const std::size_t size = PlyTypeSize(type);
    if (rest_.size() < size) return false;
    value = DecodeAs(type, rest_.data(), swap_);
    rest_.remove_prefix(size);
    return std::isfinite(value);
  }

  // A list. Its length is held against what is left before memory is taken.
  bool NextList(const PlyProperty& property, std::vector<double>& list) {
    double length = 0;
    if (!Next(*property.count_type, length)) return false;
    const std::size_t least = text_ ? 1 : PlyTypeSize(property.type);
    if (length < 0 || length > static_cast<double>(rest_.size() / least)) return false;
    list.resize(static_cast<std::size_t>(length));
    for (double& value : list) {
      if (!Next(property.type, value)) return false;
    }
    return true;
  }

 private:
  std::string_view rest_;
  bool text_, swap_;
};

// What is read of a vertex; names as exporters write them.
enum Slot { kX, kY, kZ, kNx, kNy, kNz, kRed, kGreen, kBlue, kAlpha, kU, kV, kSlots };
constexpr std::array<std::pair<std::string_view, Slot>, 26> kSlotNames = {
    {{"x", kX},          {"y", kY},         {"z", kZ},
     {"nx", kNx},        {"ny", kNy},       {"nz", kNz},
     {"red", kRed},      {"green", kGreen}, {"blue", kBlue},
     {"r", kRed},        {"g", kGreen},     {"b", kBlue},
     {"alpha", kAlpha},  {"a", kAlpha},     {"diffuse_red", kRed},
     {"u", kU},          {"v", kV},         {"diffuse_green", kGreen},
     {"s", kU},          {"t", kV},         {"diffuse_blue", kBlue},
     {"texture_u", kU},  {"texture_v", kV}, {"diffuse_alpha", kAlpha},
     {"texcoord_u", kU}, {"texcoord_v", kV}}};

// Integer colours count from 0 to the type's largest value.
double ColorScale(const PlyProperty& property) {
  return property.type == PlyType::kU8 ? 255 : property.type == PlyType::kU16 ? 65535 : 1;
}

struct Column {
  Slot slot;  // kSlots: read and forgotten
  double scale = 1;
};

std::vector<Column> VertexColumns(const PlyElement& element, std::array<bool, kSlots>& has) {
  std::vector<Column> columns;
  for (const PlyProperty& p : element.properties) {
    const auto* row = std::find_if(kSlotNames.begin(), kSlotNames.end(),
                                   [&](const auto& known) { return known.first == p.name; });
    const bool known = row != kSlotNames.end() && !p.count_type;
    columns.push_back({known ? row->second : kSlots});
    if (!known) continue;
    has[row->second] = true;
    if (row->second >= kRed && row->second <= kAlpha) columns.back().scale = ColorScale(p);
  }
  return columns;
}

class PlyBody {
 public:
  PlyBody(const PlyHeader& header, const std::string& place)
      : header_(header), place_(place), values_(header.data, header.encoding) {}

  Status Read(LoadedMesh& out) {
    for (const PlyElement& element : header_.elements) {
      if (element.name == "vertex")
        TILEGRAD_TRY(Vertices(element, out.mesh));
      else if (element.name == "face")
        TILEGRAD_TRY(Faces(element, out.mesh));
      else
        TILEGRAD_TRY(Skip(element));
    }
    if (out.mesh.corner_uvs.empty()) CornersFromVertices(out.mesh);
    return {};
  }

 private:
  Status Error(const PlyElement& element, std::size_t row, const PlyProperty& property) const {
    return DataLoss("{}: {} {}: \"{}\" is cut off or not a finite number", place_, element.name,
                    row, property.name);
  }

  Status Vertices(const PlyElement& element, Mesh& mesh) {
    std::array<bool, kSlots> has{};
    const std::vector<Column> columns = VertexColumns(element, has);
    if (!has[kX] || !has[kY] || !has[kZ])
      return DataLoss("{}: the vertices have no x, y and z", place_);
    std::array<double, kSlots + 1> row{};
    row[kAlpha] = 1;
    for (std::size_t i = 0; i < element.count; ++i) {
      for (std::size_t k = 0; k < columns.size(); ++k) {
        const PlyProperty& property = element.properties[k];
        double& to = row[columns[k].slot];
        const bool read = property.count_type ? values_.NextList(property, list_)
                                              : values_.Next(property.type, to);
        if (!read) return Error(element, i, property);
        to /= columns[k].scale;
      }
      mesh.positions.emplace_back(row[kX], row[kY], row[kZ]);
      if (has[kNx] && has[kNy] && has[kNz]) mesh.normals.emplace_back(row[kNx], row[kNy], row[kNz]);
      if (has[kRed] && has[kGreen] && has[kBlue])
        mesh.colors.emplace_back(row[kRed], row[kGreen], row[kBlue], row[kAlpha]);
      if (has[kU] && has[kV]) vertex_uvs_.emplace_back(row[kU], row[kV]);
    }
    return {};
  }

  Status Faces(const PlyElement& element, Mesh& mesh) {
    std::vector<double> uvs;
    for (std::size_t i = 0; i < element.count; ++i) {
      const std::size_t before = mesh.faces.size();
      uvs.clear();
      polygon_.corners.clear(), polygon_.triangles.clear();
      for (const PlyProperty& property : element.properties) {
        double ignored = 0;
        const bool read = property.count_type ? values_.NextList(property, list_)
                                              : values_.Next(property.type, ignored);
        if (!read) return Error(element, i, property);
        if (!property.count_type) continue;
        if (property.name == "vertex_indices" || property.name == "vertex_index")
          TILEGRAD_TRY(ReadPolygon(i, mesh));
        if (property.name == "texcoord") uvs = list_;
      }
      AddCornerUvs(uvs, before, mesh);
    }
    return {};
  }

  // The polygon whose corners are in list_.
  Status ReadPolygon(std::size_t row, Mesh& mesh) {
    const std::size_t vertices = header_.CountOf("vertex");
    for (const double index : list_) {
      if (index < 0 || index >= static_cast<double>(vertices) || index != std::floor(index)) {
        return DataLoss("{}: face {} uses vertex {}, but the file has {}", place_, row, index,
                        vertices);
      }
      polygon_.corners.push_back(static_cast<std::int32_t>(index));
    }
    polygon_.AddTo(mesh);
    return {};
  }

  // "texcoord": u and v of every corner of the polygon, in its order; 0 for a face without them.
  void AddCornerUvs(const std::vector<double>& uvs, std::size_t before, Mesh& mesh) {
    const bool given = uvs.size() == 2 * polygon_.corners.size();
    if (!given && mesh.corner_uvs.empty()) return;
    mesh.corner_uvs.resize(3 * before, glm::vec2(0));
    for (const Face& triangle : polygon_.triangles) {
      for (const std::int32_t k : triangle)
        mesh.corner_uvs.push_back(given ? glm::vec2(uvs[2 * k], uvs[2 * k + 1]) : glm::vec2(0));
    }
  }

  void CornersFromVertices(Mesh& mesh) const {
    if (vertex_uvs_.empty()) return;
    for (const Face& face : mesh.faces) {
      for (const std::int32_t v : face) mesh.corner_uvs.push_back(vertex_uvs_[v]);
    }
  }

  Status Skip(const PlyElement& element) {
    for (std::size_t i = 0; i < element.count; ++i) {
      for (const PlyProperty& property : element.properties) {
        double ignored = 0;
        const bool read = property.count_type ? values_.NextList(property, list_)
                                              : values_.Next(property.type, ignored);
        if (!read) return Error(element, i, property);
      }
    }
    return {};
  }

  const PlyHeader& header_;
  const std::string& place_;
  Values values_;
  std::vector<glm::vec2> vertex_uvs_;
  std::vector<double> list_;  // scratch: the last list
  Polygon polygon_;           // scratch: the last polygon
};

}  // namespace

Result<LoadedMesh> ReadPly(const FileSource& source, const std::string& name) {
  TILEGRAD_ASSIGN(const Bytes bytes, source.Read(name));
  const std::string place = source.Describe(name);
  TILEGRAD_ASSIGN(
      const PlyHeader header,
      ParsePlyHeader({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, place));
  LoadedMesh out;
  TILEGRAD_TRY(PlyBody(header, place).Read(out));
  if (header.texture.empty() || out.mesh.corner_uvs.empty()) return out;
  Material material{.name = header.texture, .base_color = glm::vec4(1)};
  material.base_color_texture = AddTexture(source, name, header.texture, out);
  out.mesh.materials = {material};
  return out;
}

}  // namespace tilegrad::io
