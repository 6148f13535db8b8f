// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "base/error.h"
#include "io/mesh_readers.h"
#include "io/text_scan.h"

namespace tilegrad::io {
namespace {

constexpr std::array<const char*, 3> kKindNames = {"vertex", "texture coordinate", "normal"};

// Positive indices may point forward in the file, so the largest of each kind waits for the end.
struct Largest {
  std::int64_t index = 0;
  std::size_t line = 0;
};

class ObjCheck {
 public:
  explicit ObjCheck(const std::string& name) : name_(name) {}

  Status Line(std::string_view line, std::size_t number) {
    number_ = number;
    const auto keyword = NextToken(line);
    if (keyword == "v") return Vertex(line);
    if (keyword == "vt") ++count_[1];
    if (keyword == "vn") ++count_[2];
    if (keyword == "f" || keyword == "l" || keyword == "p") return Corners(line);
    return {};
  }

  Status Finish() const {
    for (std::size_t kind = 0; kind < 3; ++kind) {
      const Largest& largest = largest_[kind];
      if (largest.index > count_[kind]) return OutOfRange(kind, largest.index, largest.line);
    }
    return {};
  }

 private:
  Status Vertex(std::string_view line) {
    ++count_[0];
    for (int c = 0; c < 3; ++c) {
      const auto token = NextToken(line);
      float value = 0;
      if (!ParseNumber(token, value)) {
        return DataLoss("{}: line {}: a vertex needs three finite numbers, got \"{}\"", name_,
                        number_, token);
      }
    }
    return {};
  }

  Status Corners(std::string_view line) {
    for (auto token = NextToken(line); !token.empty() && token[0] != '#'; token = NextToken(line))
      TILEGRAD_TRY(Corner(token));
    return {};
  }

  // "v/vt/vn", any of the last two left out.
  Status Corner(const std::string_view whole) {
    std::string_view token = whole;
    for (std::size_t kind = 0; kind < 3; ++kind) {
      const auto slash = token.find('/');
      const auto part = token.substr(0, slash);
      if (!part.empty() || kind == 0) {
        std::int64_t index = 0;
        if (!ParseNumber(part, index)) break;
        TILEGRAD_TRY(Index(kind, index));
      }
      if (slash == std::string_view::npos) return {};
      token.remove_prefix(slash + 1);
    }
    return DataLoss("{}: line {}: \"{}\" is not a corner of a face (v, v/vt, v//vn or v/vt/vn)",
                    name_, number_, whole);
  }

  Status Index(std::size_t kind, std::int64_t index) {
    if (index == 0 || index < -count_[kind]) return OutOfRange(kind, index, number_);
    if (index > largest_[kind].index) largest_[kind] = {index, number_};
    return {};
  }

  Status OutOfRange(std::size_t kind, std::int64_t index, std::size_t line) const {
    return DataLoss("{}: line {}: a face uses {} {}, but the file has {}", name_, line,
                    kKindNames[kind], index, count_[kind]);
  }

  const std::string& name_;
  std::size_t number_ = 0;
  std::array<std::int64_t, 3> count_ = {0, 0, 0};  // v, vt, vn so far
  std::array<Largest, 3> largest_;
};

}  // namespace

Status CheckObj(std::string_view text, const std::string& name) {
  ObjCheck check(name);
  Lines lines(text);
  std::string joined;  // a trailing backslash continues the line
  for (std::string_view line; lines.Next(line);) {
    if (line.ends_with('\\')) {
      joined.append(line.substr(0, line.size() - 1)) += ' ';
      continue;
    }
    if (!joined.empty()) {
      joined += line;
      line = joined;
    }
    TILEGRAD_TRY(check.Line(line, lines.Number()));
    joined.clear();
  }
  return check.Finish();
}

}  // namespace tilegrad::io
