// SPDX-License-Identifier: Apache-2.0
// Geomview's OFF and COFF as text: a line of counts, a line a vertex, a line a face.
#include <algorithm>

#include "base/error.h"
#include "io/mesh_readers.h"
#include "io/text_scan.h"

namespace tilegrad::io {
namespace {

struct OffFile {
  Lines lines;
  const std::string& place;

  // The next line that is neither empty nor a comment.
  bool Next(std::string_view& line) {
    while (lines.Next(line)) {
      line = line.substr(0, line.find('#'));
      if (line.find_first_not_of(" \t\r") != std::string_view::npos) return true;
    }
    return false;
  }
  Status Error(const std::string& what) const {
    return DataLoss("{}: line {}: {}", place, lines.Number(), what);
  }
};

struct OffCounts {
  std::size_t vertices = 0, faces = 0;
  bool colors = false;
};

// "OFF" or "COFF", and the counts in the same line or the next one; some writers leave out the
// space between ("OFF490 518 0").
Result<OffCounts> ReadCounts(OffFile& file) {
  std::string_view line;
  if (!file.Next(line)) return DataLoss("{}: empty", file.place);
  line.remove_prefix(line.find_first_not_of(" \t"));
  OffCounts counts;
  counts.colors = line.starts_with("COFF");
  if (counts.colors) line.remove_prefix(1);
  if (!line.starts_with("OFF"))
    return file.Error("does not begin with OFF or COFF (other variants are not read)");
  line.remove_prefix(3);
  if (line.find_first_not_of(" \t\r") == std::string_view::npos && !file.Next(line))
    return file.Error("the counts are missing");
  if (!ParseNumber(NextToken(line), counts.vertices) || !ParseNumber(NextToken(line), counts.faces))
    return file.Error("expected the numbers of vertices and faces");
  // Three characters a vertex or face are the least: "0 0 0" and "3 0 1 2" take more.
  const std::size_t most = file.lines.Rest().size() / 3;
  if (counts.vertices > most || counts.faces > most) {
    return file.Error(fmt::format("{} vertices and {} faces are more than the file can hold",
                                  counts.vertices, counts.faces));
  }
  return counts;
}

Status ReadVertices(OffFile& file, const OffCounts& counts, Mesh& mesh) {
  for (std::size_t i = 0; i < counts.vertices; ++i) {
    std::string_view line;
    if (!file.Next(line)) return file.Error(fmt::format("ends at vertex {}", i));
    glm::vec3 p;
    for (int c = 0; c < 3; ++c) {
      if (!ParseNumber(NextToken(line), p[c]))
        return file.Error("a vertex needs three finite numbers");
    }
    mesh.positions.push_back(p);
    if (!counts.colors) continue;
    glm::vec4 color(1);
    for (int c = 0; c < 4; ++c) {
      const auto token = NextToken(line);
      if (c == 3 && token.empty()) break;
      if (!ParseNumber(token, color[c])) return file.Error("a colour needs three or four numbers");
      if (token.find('.') == std::string_view::npos) color[c] /= 255;  // integers are 0..255
    }
    mesh.colors.push_back(color);
  }
  return {};
}

Status ReadFaces(OffFile& file, const OffCounts& counts, LoadedMesh& out) {
  Polygon polygon;
  for (std::size_t f = 0; f < counts.faces; ++f) {
    std::string_view line;
    if (!file.Next(line)) return file.Error(fmt::format("ends at face {}", f));
    std::size_t corners = 0;
    if (!ParseNumber(NextToken(line), corners) || corners > line.size())
      return file.Error("expected the number of corners");
    polygon.corners.clear();
    for (std::size_t k = 0; k < corners; ++k) {
      std::int32_t index = 0;
      if (!ParseNumber(NextToken(line), index))
        return file.Error(fmt::format("corner {} is missing", k));
      if (index < 0 || static_cast<std::size_t>(index) >= counts.vertices) {
        return file.Error(
            fmt::format("vertex {}, but the file has {} (from 0)", index, counts.vertices));
      }
      polygon.corners.push_back(index);
    }
    polygon.AddTo(out.mesh);
  }
  return {};
}

}  // namespace

Result<LoadedMesh> ReadOff(const FileSource& source, const std::string& name) {
  TILEGRAD_ASSIGN(const Bytes bytes, source.Read(name));
  const std::string place = source.Describe(name);
  OffFile file{Lines({reinterpret_cast<const char*>(bytes.data()), bytes.size()}), place};
  LoadedMesh out;
  TILEGRAD_ASSIGN(const OffCounts counts, ReadCounts(file));
  TILEGRAD_TRY(ReadVertices(file, counts, out.mesh));
  TILEGRAD_TRY(ReadFaces(file, counts, out));
  return out;
}

}  // namespace tilegrad::io
