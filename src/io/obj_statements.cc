// SPDX-License-Identifier: Apache-2.0
#include "io/obj_statements.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>
#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "io/mesh_readers.h"
#include "io/text_scan.h"

namespace tilegrad::io {
namespace {

// Iterates over statements: skips comments and empty lines, joins a line that ends with a backslash
// with the next one. Lines end with \n, \r\n or \r. Skips a UTF-8 byte order mark.
class ObjLines {
 public:
  explicit ObjLines(std::string_view text) : rest_(WithoutByteOrderMark(text)) {}

  // The keyword, and its arguments without surrounding white space; valid until the next call.
  bool Next(std::string_view& keyword, std::string_view& rest) {
    joined_.clear();
    std::string_view line;
    while (NextLine(line)) {
      // A comment may end with a backslash: the folder of a Windows path.
      if (joined_.empty() && line.starts_with('#')) continue;
      if (line.ends_with('\\')) {
        joined_.append(line.substr(0, line.size() - 1)) += ' ';
        if (!rest_.empty()) continue;
        line = {};
      }
      if (!joined_.empty()) line = joined_ += line;
      keyword = NextToken(line);
      rest = Trimmed(line);
      if (!keyword.empty()) return true;
      joined_.clear();
    }
    return false;
  }
  std::size_t Number() const { return number_; }  // of the statement's last line, from 1

 private:
  bool NextLine(std::string_view& line) {
    if (rest_.empty()) return false;
    ++number_;
    std::size_t end = 0;
    while (end < rest_.size() && rest_[end] != '\n' && rest_[end] != '\r') ++end;
    line = Trimmed(rest_.substr(0, end));
    rest_.remove_prefix(end);
    if (!rest_.empty()) rest_.remove_prefix(IsWindowsEnd() ? 2 : 1);
    return true;
  }

  bool IsWindowsEnd() const { return rest_.size() >= 2 && rest_[0] == '\r' && rest_[1] == '\n'; }

  std::string_view rest_;
  std::string joined_;
  std::size_t number_ = 0;
};

constexpr std::array<const char*, 3> kKindNames = {"vertex", "texture coordinate", "normal"};

// Positive indices may refer forward in the file, so the largest of each kind is checked at the
// end.
struct Largest {
  std::int64_t index = 0;
  std::size_t line = 0;
};

// Names, shading and grouping, which a triangle mesh does not need.
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
    // Most lines are one of the first two.
    const char letter = keyword.size() == 1 ? keyword[0] : '\0';
    if (letter == 'v') return Vertex(rest);
    if (letter == 'f') return Face(rest);
    if (letter == 'l' || letter == 'p') return LineOrPoints(rest);
    if (keyword == "vt") return TextureCoordinate(rest);
    if (keyword == "vn") return Normal(rest);
    if (keyword == "usemtl") {
      UseMaterial(WholeName(rest));
    } else if (keyword == "mtllib") {
      out.libraries.emplace_back(rest);
    } else if (!SaysNothingAboutTriangles(keyword)) {
      not_read_.emplace(keyword);
    }
    return {};
  }

  // Reads up to `most` numbers, up to the end or a comment. Returns their count; -1: `bad_` is no
  // number.
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
    TILEGRAD_TRY(Corners(rest));  // checks that they exist
    out.corners.resize(before);
    lines_or_points_ = true;
    return {};
  }

  Status Corners(std::string_view rest) {
    for (auto token = NextToken(rest); !token.empty() && token[0] != '#'; token = NextToken(rest))
      TILEGRAD_TRY(Corner(token));
    return {};
  }

  // "v/vt/vn", the last two optional.
  Status Corner(const std::string_view whole) {
    std::string_view token = whole;
    ObjCorner corner = {-1, -1, -1};
    for (std::size_t kind = 0; kind < 3; ++kind) {
      std::size_t slash = 0;
      while (slash < token.size() && token[slash] != '/') ++slash;
      const auto part = token.substr(0, slash);
      if (!part.empty() || kind == 0) {
        std::int64_t index = ShortNumber(part);
        if (index < 0 && !ParseNumber(part, index)) break;
        TILEGRAD_TRY(Index(kind, index, corner[kind]));
      }
      if (slash == token.size()) {
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

// Keywords for other lighting models only.
bool IsOfOtherLighting(std::string_view keyword) {
  constexpr std::array<std::string_view, 14> kKeywords = {
      "ka", "ks", "ns", "ni", "tf",  "illum", "sharpness",
      "pr", "pm", "ps", "pc", "pcr", "aniso", "anisor"};
  return std::find(kKeywords.begin(), kKeywords.end(), keyword) != kKeywords.end();
}

// Skipped options of images, with the number of their arguments.
struct SkippedOption {
  std::string_view name;
  int least, most;     // those after `least` are numbers
  bool changes_image;  // beyond how it is filtered
};
constexpr std::array<SkippedOption, 10> kSkippedOptions = {{{"-blendu", 1, 1, false},
                                                            {"-blendv", 1, 1, false},
                                                            {"-boost", 1, 1, false},
                                                            {"-texres", 1, 1, false},
                                                            {"-cc", 1, 1, true},
                                                            {"-bm", 1, 1, true},
                                                            {"-imfchan", 1, 1, true},
                                                            {"-type", 1, 1, true},
                                                            {"-mm", 1, 2, true},
                                                            {"-t", 1, 3, true}}};

class MtlParser {
 public:
  MtlParser(std::string_view text, const std::string& place) : lines_(text), place_(place) {}

  Status Parse() {
    for (std::string_view keyword, rest; lines_.Next(keyword, rest);)
      TILEGRAD_TRY(Statement(LowerCase(keyword), rest));
    return {};
  }

  MtlLibrary out;

 private:
  Status Statement(const std::string& keyword, std::string_view rest) {
    if (keyword == "newmtl") {
      out.materials.push_back({.name = std::string(WholeName(rest))});
      has_d_ = false;
      return {};
    }
    if (out.materials.empty()) return {};  // belongs to no material
    if (keyword == "kd") return Diffuse(rest);
    if (keyword == "d") return Opacity(rest);
    if (keyword == "tr") return Transparency(rest);
    if (keyword == "map_kd") return Image(rest);
    if (keyword == "ke" ? IsBlack(rest) : IsOfOtherLighting(keyword)) return {};
    out.not_read.insert(keyword);
    return {};
  }

  MtlMaterial& material() { return out.materials.back(); }

  Status Error(std::string_view keyword, std::string_view got) const {
    return DataLoss("{}: line {}: {} needs finite numbers, got \"{}\"", place_, lines_.Number(),
                    keyword, got.substr(0, 80));
  }

  // Takes up to `most` leading numbers off `rest`.
  static int TakeNumbers(std::string_view& rest, float* values, int most) {
    int count = 0;
    for (std::string_view after = rest; count < most; rest = after) {
      if (!ParseNumber(NextToken(after), values[count])) break;
      ++count;
    }
    return count;
  }

  static bool IsBlack(std::string_view rest) {
    std::array<float, 3> n = {};
    TakeNumbers(rest, n.data(), 3);
    return n == std::array<float, 3>{};
  }

  // r g b, or r alone for all three.
  Status Diffuse(std::string_view rest) {
    if (rest.starts_with("spectral") || rest.starts_with("xyz")) {
      out.not_read.insert("Kd " + std::string(NextToken(rest)));
      return {};
    }
    std::array<float, 3> n;
    const std::string_view whole = rest;
    const int count = TakeNumbers(rest, n.data(), 3);
    if (count != 3 && (count != 1 || !NextToken(rest).empty())) return Error("Kd", whole);
    if (count == 1) n[1] = n[2] = n[0];
    material().diffuse = {n[0], n[1], n[2]};
    return {};
  }

  Status Opacity(std::string_view rest) {
    if (rest.starts_with("-halo")) {
      NextToken(rest);
      out.not_read.insert("d -halo");
    }
    has_d_ = true;
    return TakeNumbers(rest, &material().opacity, 1) == 1 ? Status() : Error("d", rest);
  }

  // Files with both mean the same; some write "Tr 1" beside "d 1", so d wins.
  Status Transparency(std::string_view rest) {
    float transparency = 0;
    if (TakeNumbers(rest, &transparency, 1) != 1) return Error("Tr", rest);
    if (!has_d_) material().opacity = 1 - transparency;
    return {};
  }

  // Options, then a name that may contain spaces.
  Status Image(std::string_view rest) {
    MtlImage image;
    while (rest.starts_with('-')) {
      std::string_view after = rest;
      const std::string option = LowerCase(NextToken(after));
      if (!Option(option, after, image)) break;  // then it is a name
      rest = Trimmed(after);
    }
    image.name = WholeName(rest);
    material().image = std::move(image);
    return {};
  }

  // Takes the option's values off `rest`; false if there is no such option.
  bool Option(const std::string& option, std::string_view& rest, MtlImage& image) {
    std::array<float, 3> n;
    if (option == "-s" || option == "-o") {
      glm::vec2& to = option == "-s" ? image.scale : image.offset;
      const int count = TakeNumbers(rest, n.data(), 3);
      for (int c = 0; c < std::min(count, 2); ++c) to[c] = n[static_cast<std::size_t>(c)];
      return true;
    }
    if (option == "-clamp") {
      image.clamp = LowerCase(NextToken(rest)) == "on";
      return true;
    }
    const auto* skipped = std::find_if(kSkippedOptions.begin(), kSkippedOptions.end(),
                                       [&](const auto& row) { return row.name == option; });
    if (skipped == kSkippedOptions.end()) return false;
    for (int i = 0; i < skipped->least; ++i) NextToken(rest);
    TakeNumbers(rest, n.data(), skipped->most - skipped->least);
    if (skipped->changes_image) out.not_read.insert("map_Kd " + option);
    return true;
  }

  ObjLines lines_;
  const std::string& place_;
  bool has_d_ = false;
};

}  // namespace

std::string_view WholeName(std::string_view rest) {
  rest = Trimmed(rest);
  const bool quoted = rest.size() >= 2 && rest.front() == '"' && rest.back() == '"';
  return quoted ? rest.substr(1, rest.size() - 2) : rest;
}

std::string_view WithoutComment(std::string_view name) {
  for (std::size_t at = name.find('#', 1); at < name.size(); at = name.find('#', at + 1)) {
    if (name[at - 1] == ' ' || name[at - 1] == '\t') return WholeName(name.substr(0, at));
  }
  return name;
}

Result<ObjStatements> ParseObj(std::string_view text, const std::string& place) {
  TILEGRAD_TRY(CheckTextEncoding(text, place));
  ObjParser parser(text, place);
  TILEGRAD_TRY(parser.Parse());
  return std::move(parser.out);
}

Result<MtlLibrary> ParseMtl(std::string_view text, const std::string& place) {
  TILEGRAD_TRY(CheckTextEncoding(text, place));
  MtlParser parser(text, place);
  TILEGRAD_TRY(parser.Parse());
  return std::move(parser.out);
}

}  // namespace tilegrad::io
