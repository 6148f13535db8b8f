// SPDX-License-Identifier: Apache-2.0
// Geomview's OFF and COFF as text: a line of counts, a line per vertex, a line per face.
#include <algorithm>

#include "base/error.h"
#include "base/text.h"
#include "io/mesh_readers.h"
#include "io/text_scan.h"

namespace tilegrad::io {
namespace {

struct OffFile : Lines {
  using Lines::Lines;

  // The next line that is neither empty nor a comment.
  bool Next(std::string_view& line) {
    while (Lines::Next(line)) {
      line = line.substr(0, line.find('#'));
      if (line.find_first_not_of(" \t\r") != std::string_view::npos) return true;
    }
    return false;
  }
};

struct OffCounts {
  std::size_t vertices = 0, faces = 0;
  bool colors = false;
};

// "OFF" or "COFF", and the counts on the same line or the next one; some writers omit the space
// between ("OFF490 518 0").
Result<OffCounts> ReadCounts(OffFile& file) {
  std::string_view line;
  if (!file.Next(line)) return DataLoss("{}: empty", file.place());
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
  // A vertex or face takes at least three characters: "0 0 0" and "3 0 1 2" take more.
  const std::size_t most = file.Rest().size() / 3;
  if (counts.vertices > most || counts.faces > most) {
    return file.Error("{} vertices and {} faces are more than the file can hold", counts.vertices,
                      counts.faces);
  }
  return counts;
}

// Colours of vertices or of faces. Integers range from 0 to 255, except in colours of only 0 and 1
// in files that also have fractions or nothing above 1.
class OffColors {
 public:
  // Reads the rest of a line. False unless it is empty or three or four numbers.
  bool Add(std::string_view rest) {
    glm::vec4 color(1);
    bool fractions = false, good = true;
    int count = 0;
    for (auto token = NextToken(rest); !token.empty() && good; token = NextToken(rest)) {
      good = count < 4 && ParseNumber(token, color[count++]);
      fractions = fractions || token.find_first_of(".eE") != std::string_view::npos;
    }
    good = good && (count == 0 || count >= 3);
    if (!good || count == 0) {
      rows_.push_back({glm::vec4(1), 0});
      return good;
    }
    rows_.push_back({color, fractions ? 0 : count});
    any_ = true;
    fractions_ = fractions_ || fractions;
    most_ = std::max({most_, color.r, color.g, color.b, count == 4 ? color.a : 0});
    return true;
  }

  // One per line, white for lines without one; empty if no line has one.
  std::vector<glm::vec4> Take() const {
    std::vector<glm::vec4> colors;
    for (const Row& row : rows_) {
      if (!any_) break;
      colors.push_back(row.color);
      const glm::vec4& c = row.color;
      if ((fractions_ || most_ <= 1) && std::max({c.r, c.g, c.b, c.a}) <= 1) continue;
      for (int k = 0; k < row.integers; ++k) colors.back()[k] /= 255;
    }
    return colors;
  }

 private:
  struct Row {
    glm::vec4 color;
    int integers;  // how many of its numbers are integers: all or none
  };
  std::vector<Row> rows_;
  float most_ = 0;
  bool any_ = false, fractions_ = false;
};

class OffReader {
 public:
  OffReader(OffFile file, LoadedMesh& out) : file_(std::move(file)), out_(out) {}

  Status Read() {
    TILEGRAD_ASSIGN(counts_, ReadCounts(file_));
    TILEGRAD_TRY(ReadVertices());
    TILEGRAD_TRY(ReadFaces());
    AddFaceColors();
    if (odd_lines_ > 0) {
      out_.Warn("extra values on {} of vertices or faces left out: not a colour",
                Count(odd_lines_, "line"));
    }
    return {};
  }

 private:
  Status ReadVertices() {
    OffColors colors;
    for (std::size_t i = 0; i < counts_.vertices; ++i) {
      std::string_view line;
      if (!file_.Next(line)) return file_.Error("ends at vertex {}", i);
      glm::dvec3 p;
      for (int c = 0; c < 3; ++c) {
        if (!ParseNumber(NextToken(line), p[c]))
          return file_.Error("a vertex needs three finite numbers");
      }
      out_.exact.push_back(p);
      const bool good = colors.Add(line);
      if (!good && counts_.colors) return file_.Error("a colour needs three or four numbers");
      odd_lines_ += !good;
    }
    out_.mesh.colors = colors.Take();
    return {};
  }

  Status ReadFaces() {
    Polygon polygon;
    for (std::size_t f = 0; f < counts_.faces; ++f) {
      std::string_view line;
      if (!file_.Next(line)) return file_.Error("ends at face {}", f);
      TILEGRAD_TRY(ReadCorners(line, polygon));
      odd_lines_ += !face_colors_.Add(line);
      polygon.AddTo(out_);
      polygon_of_.resize(out_.mesh.faces.size(), f);
    }
    return {};
  }

  // Takes the number of corners and the corners off the line.
  Status ReadCorners(std::string_view& line, Polygon& polygon) const {
    std::size_t corners = 0;
    if (!ParseNumber(NextToken(line), corners) || corners > line.size())
      return file_.Error("expected the number of corners");
    polygon.corners.clear();
    for (std::size_t k = 0; k < corners; ++k) {
      std::int32_t index = 0;
      if (!ParseNumber(NextToken(line), index)) return file_.Error("corner {} is missing", k);
      if (index < 0 || static_cast<std::size_t>(index) >= counts_.vertices)
        return file_.Error("vertex {}, but the file has {} (from 0)", index, counts_.vertices);
      polygon.corners.push_back(index);
    }
    return {};
  }

  void AddFaceColors() {
    const std::vector<glm::vec4> colors = face_colors_.Take();
    if (colors.empty()) return;
    if (!out_.mesh.colors.empty()) {
      out_.Warn("colours of faces left out: the vertices have their own");
      return;
    }
    for (const std::size_t polygon : polygon_of_)
      out_.mesh.corner_colors.insert(out_.mesh.corner_colors.end(), 3, colors[polygon]);
  }

  OffFile file_;
  LoadedMesh& out_;
  OffCounts counts_;
  OffColors face_colors_;                // of polygons
  std::vector<std::size_t> polygon_of_;  // of each face
  std::size_t odd_lines_ = 0;
};

}  // namespace

Result<LoadedMesh> ReadOff(const FileSource& source, const std::string& name) {
  TILEGRAD_ASSIGN(const Bytes bytes, source.Read(name));
  LoadedMesh out;
  OffReader reader(OffFile(TextOf(bytes), source.Describe(name)), out);
  TILEGRAD_TRY(reader.Read());
  return out;
}

}  // namespace tilegrad::io
