// SPDX-License-Identifier: Apache-2.0
#include "io/obj/obj_statements.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <unordered_map>

#include "base/error.h"
#include "base/text.h"
#include "io/mesh_colors.h"
#include "io/mesh_readers.h"
#include "io/obj/obj_text.h"
#include "io/text_scan.h"

namespace tilegrad::io {
namespace {

constexpr std::array<const char*, 3> kKindNames = {"vertex", "texture coordinate", "normal"};

// Positive indices may point forward in the file, so the largest of each kind waits for the end.
struct Largest {
  std::int64_t index = 0;
  std::size_t line = 0;
};

// Names, shading and grouping, which a triangle mesh has no place for and loses nothing by.
bool SaysNothingAboutTriangles(std::string_view keyword) {
  constexpr std::array<std::string_view, 11> kKeywords = {
      "o", "g", "s", "mg", "lod", "bevel", "c_interp", "d_interp", "vp", "shadow_obj", "trace_obj"};
  return std::find(kKeywords.begin(), kKeywords.end(), keyword) != kKeywords.end();
}

class ObjParser {
 public:
  ObjParser(std::string_view text, const std::string& place) : lines_(text), place_(place) {}

  Status Parse() {
    for (std::string_view keyword, rest; lines_.Next(keyword, rest);)
      TILEGRAD_TRY(Statement(keyword, rest));
    for (std::size_t kind = 0; kind < 3; ++kind) {
      const Largest& largest = largest_[kind];
      if (largest.index > Count(kind)) return OutOfRange(kind, largest.index, largest.line);
    }
    AddWarnings();
    return {};
  }

  ObjStatements out;

 private:
  Status Statement(std::string_view keyword, std::string_view rest) {
    if (keyword == "v") return Vertex(rest);
    if (keyword == "vt") return TextureCoordinate(rest);
    if (keyword == "vn") return Normal(rest);
    if (keyword == "f") return Face(rest);
    if (keyword == "l" || keyword == "p") return LineOrPoints(rest);
    if (keyword == "usemtl") {
      UseMaterial(WholeName(rest));
    } else if (keyword == "mtllib") {
      out.libraries.emplace_back(rest);
    } else if (!SaysNothingAboutTriangles(keyword)) {
      not_read_.emplace(keyword);
    }
    return {};
  }

  // Up to `most` numbers, up to the end or a comment. Returns how many; -1: `bad_` is none.
  int Numbers(std::string_view rest, double* values, int most, bool finite = true) {
    int count = 0;
    for (bad_ = NextToken(rest); !bad_.empty() && bad_[0] != '#' && count < most;
         bad_ = NextToken(rest)) {
      if (!ParseAnyNumber(bad_, values[count])) return -1;
      if (finite && !std::isfinite(values[count])) return -1;
      ++count;
    }
    return count;
  }

  Status Error(std::string_view what) const {
    return DataLoss("{}: line {}: {}", place_, lines_.Number(), what);
  }

  Status NeedsNumbers(const char* what) const {
    return Error(fmt::format("{}, got \"{}\"", what, bad_.substr(0, 80)));
  }

  // x y z, then nothing, w (which divides), r g b, or r g b a.
  Status Vertex(std::string_view rest) {
    std::array<double, 8> n;
    const int count = Numbers(rest, n.data(), 8);
    glm::dvec3 p(n[0], n[1], n[2]);
    if (count < 3) return NeedsNumbers("a vertex needs three finite numbers");
    if (count == 4) p /= n[3];
    const auto fits = [](double c) { return std::abs(c) <= std::numeric_limits<float>::max(); };
    if (!fits(p.x) || !fits(p.y) || !fits(p.z))
      return NeedsNumbers("a vertex needs three finite numbers in float's range");
    if (count == 5 || count == 8) ++odd_vertices_;
    if (count >= 6) {
      out.colors.resize(out.positions.size(), kNoColor);
      out.colors.emplace_back(n[3], n[4], n[5], count >= 7 ? n[6] : 1);
    }
    out.positions.push_back(p);
    return CheckCount(out.positions.size());
  }

  Status TextureCoordinate(std::string_view rest) {
    std::array<double, 2> n = {0, 0};
    if (Numbers(rest, n.data(), 2) < 1)
      return NeedsNumbers("a texture coordinate needs finite numbers");
    out.uvs.emplace_back(n[0], n[1]);
    return CheckCount(out.uvs.size());
  }

  Status Normal(std::string_view rest) {
    std::array<double, 3> n;
    if (Numbers(rest, n.data(), 3, /*finite=*/false) < 3)
      return NeedsNumbers("a normal needs three numbers");
    out.normals.emplace_back(n[0], n[1], n[2]);
    return CheckCount(out.normals.size());
  }

  Status Face(std::string_view rest) {
    const std::size_t before = out.corners.size();
    TILEGRAD_TRY(Corners(rest));
    const std::size_t count = out.corners.size() - before;
    if (count < 3) {
      out.corners.resize(before);
      ++small_faces_;
      return {};
    }
    out.polygons.push_back({static_cast<std::uint32_t>(count), material_});
    return CheckCount(out.corners.size());
  }

  Status LineOrPoints(std::string_view rest) {
    const std::size_t before = out.corners.size();
    TILEGRAD_TRY(Corners(rest));  // to see that they exist
    out.corners.resize(before);
    lines_or_points_ = true;
    return {};
  }

  Status Corners(std::string_view rest) {
    for (auto token = NextToken(rest); !token.empty() && token[0] != '#'; token = NextToken(rest))
      TILEGRAD_TRY(Corner(token));
    return {};
  }

  // "v/vt/vn", any of the last two left out.
  Status Corner(const std::string_view whole) {
    std::string_view token = whole;
    ObjCorner corner = {-1, -1, -1};
    for (std::size_t kind = 0; kind < 3; ++kind) {
      const auto slash = token.find('/');
      const auto part = token.substr(0, slash);
      if (!part.empty() || kind == 0) {
        std::int64_t index = 0;
        if (!ParseNumber(part, index)) break;
        TILEGRAD_TRY(Index(kind, index, corner[kind]));
      }
      if (slash == std::string_view::npos) {
        out.corners.push_back(corner);
        return {};
      }
      token.remove_prefix(slash + 1);
    }
    return Error(
        fmt::format("\"{}\" is not a corner of a face (v, v/vt, v//vn or v/vt/vn)", whole));
  }

  // Negative indices count from the last element so far.
  Status Index(std::size_t kind, std::int64_t index, std::int32_t& out_index) {
    if (index == 0 || index < -Count(kind)) return OutOfRange(kind, index, lines_.Number());
    if (index > largest_[kind].index) largest_[kind] = {index, lines_.Number()};
    const std::int64_t from_0 = index > 0 ? index - 1 : Count(kind) + index;
    constexpr std::int64_t kMost = std::numeric_limits<std::int32_t>::max();
    out_index = static_cast<std::int32_t>(std::min(from_0, kMost));  // too large: an error soon
    return {};
  }

  std::int64_t Count(std::size_t kind) const {
    return kind == 0   ? std::ssize(out.positions)
           : kind == 1 ? std::ssize(out.uvs)
                       : std::ssize(out.normals);
  }

  Status OutOfRange(std::size_t kind, std::int64_t index, std::size_t line) const {
    return DataLoss("{}: line {}: a face uses {} {}, but the file has {}", place_, line,
                    kKindNames[kind], index, Count(kind));
  }

  Status CheckCount(std::size_t count) const {
    if (count <= 3 * kMaxMeshElements) return {};
    return ResourceExhausted("{}: line {}: more than {} vertices or faces", place_, lines_.Number(),
                             kMaxMeshElements);
  }

  void UseMaterial(std::string_view name) {
    const auto next = static_cast<std::int32_t>(out.materials.size());
    const auto [found, added] = materials_.try_emplace(std::string(name), next);
    if (added) out.materials.emplace_back(name);
    material_ = found->second;
  }

  void AddWarnings() {
    const auto warn = [&](std::string text) { out.warnings.push_back(std::move(text)); };
    if (!out.colors.empty()) out.colors.resize(out.positions.size(), kNoColor);
    if (lines_or_points_) warn("points or lines left out");
    if (small_faces_ > 0)
      warn(tilegrad::Count(small_faces_, "face") + " with fewer than three corners left out");
    if (odd_vertices_ > 0) {
      warn(fmt::format("vertices with 5 or more than 7 numbers, of which 3 or 7 are read: {}",
                       odd_vertices_));
    }
    if (!not_read_.empty())
      warn(fmt::format("statements that are not read: {}", ShortList(not_read_)));
  }

  ObjLines lines_;
  const std::string& place_;
  std::array<Largest, 3> largest_;
  std::string_view bad_;  // where Numbers stopped
  std::int32_t material_ = -1;
  std::unordered_map<std::string, std::int32_t> materials_;  // index by name
  std::size_t small_faces_ = 0, odd_vertices_ = 0;
  bool lines_or_points_ = false;
  std::set<std::string, std::less<>> not_read_;
};

}  // namespace

Result<ObjStatements> ParseObj(std::string_view text, const std::string& place) {
  TILEGRAD_TRY(CheckTextEncoding(text, place));
  ObjParser parser(text, place);
  TILEGRAD_TRY(parser.Parse());
  return std::move(parser.out);
}

}  // namespace tilegrad::io
