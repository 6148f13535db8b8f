// SPDX-License-Identifier: Apache-2.0
#include <charconv>
#include <cstdint>
#include <vector>

#include "base/error.h"
#include "io/mesh_readers.h"

namespace tilegrad::io {
namespace {

struct Counts {
  std::int64_t of[3] = {0, 0, 0};  // v, vt, vn
};

struct Reference {
  std::size_t line;
  int kind;            // 0 v, 1 vt, 2 vn
  std::int64_t index;  // 1-based, resolved if it was relative
  std::int64_t written;
};

constexpr const char* kKindNames[3] = {"vertex", "texture coordinate", "normal"};

std::string_view NextToken(std::string_view& rest) {
  const auto begin = rest.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return rest = {};
  const auto end = std::min(rest.find_first_of(" \t\r", begin), rest.size());
  const auto token = rest.substr(begin, end - begin);
  rest.remove_prefix(end);
  return token;
}

// One corner "v/vt/vn", any of the last two left out. False if it is not of that form.
bool ParseCorner(std::string_view token, std::size_t line, const Counts& counts,
                 std::vector<Reference>& out) {
  for (int kind = 0; kind < 3; ++kind) {
    const auto slash = std::min(token.find('/'), token.size());
    const auto part = token.substr(0, slash);
    if (part.empty() && kind == 0) return false;
    if (!part.empty()) {
      std::int64_t value = 0;
      const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), value);
      if (error != std::errc() || end != part.data() + part.size()) return false;
      out.push_back({line, kind, value < 0 ? counts.of[kind] + 1 + value : value, value});
    }
    if (slash == token.size()) return true;
    token.remove_prefix(slash + 1);
  }
  return false;
}

int KindOf(std::string_view keyword) {
  return keyword == "v" ? 0 : keyword == "vt" ? 1 : keyword == "vn" ? 2 : -1;
}

}  // namespace

Status CheckObjIndices(std::string_view text, const std::string& name) {
  Counts counts;
  std::vector<Reference> references;
  std::size_t line_number = 0;
  while (!text.empty()) {
    ++line_number;
    const auto end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    const auto keyword = NextToken(line);
    if (const int kind = KindOf(keyword); kind >= 0) ++counts.of[kind];
    if (keyword != "f") continue;
    for (auto token = NextToken(line); !token.empty() && token[0] != '#' && token != "\\";
         token = NextToken(line)) {
      if (!ParseCorner(token, line_number, counts, references)) {
        return DataLoss("{}: line {}: \"{}\" is not a corner of a face (v, v/vt, v//vn or v/vt/vn)",
                        name, line_number, token);
      }
    }
  }
  for (const auto& [line, kind, index, written] : references) {
    if (index < 1 || index > counts.of[kind]) {
      return DataLoss("{}: line {}: a face uses {} {}, but the file has {}", name, line,
                      kKindNames[kind], written, counts.of[kind]);
    }
  }
  return {};
}

}  // namespace tilegrad::io
