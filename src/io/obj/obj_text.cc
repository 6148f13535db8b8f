// SPDX-License-Identifier: Apache-2.0
#include "io/obj/obj_text.h"

#include "io/text_scan.h"

namespace tilegrad::io {

ObjLines::ObjLines(std::string_view text) : rest_(WithoutByteOrderMark(text)) {}

bool ObjLines::NextLine(std::string_view& line) {
  if (rest_.empty()) return false;
  ++number_;
  const auto end = rest_.find_first_of("\r\n");
  line = Trimmed(rest_.substr(0, end));
  if (end == std::string_view::npos) {
    rest_ = {};
  } else {
    rest_.remove_prefix(end + (rest_.substr(end).starts_with("\r\n") ? 2 : 1));
  }
  return true;
}

bool ObjLines::Next(std::string_view& keyword, std::string_view& rest) {
  joined_.clear();
  std::string_view line;
  while (NextLine(line)) {
    // A comment may well end with a backslash: the folder of a Windows path.
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

}  // namespace tilegrad::io
