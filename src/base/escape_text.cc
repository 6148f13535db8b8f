// SPDX-License-Identifier: Apache-2.0
#include "base/escape_text.h"

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>

#include "base/text.h"

namespace tilegrad {
namespace {

bool IsControl(std::uint32_t code) {
  const bool layout = code == '\n' || code == '\t';
  const bool marks = code == 0x061c || (code >= 0x200e && code <= 0x200f) ||
                     (code >= 0x202a && code <= 0x202e) ||
                     (code >= 0x2066 && code <= 0x2069);  // of the direction of writing
  const bool breaks = code == 0x2028 || code == 0x2029;   // of lines and paragraphs
  return (code < 0x20 && !layout) || (code >= 0x7f && code < 0xa0) || marks || breaks;
}

// "&lt;" for '<'; empty for characters that need none.
std::string_view HtmlEntity(char c) {
  switch (c) {
    case '&':
      return "&amp;";
    case '<':
      return "&lt;";
    case '>':
      return "&gt;";
    case '"':
      return "&quot;";
    case '\'':
      return "&#39;";
    default:
      return "";
  }
}

}  // namespace

std::string EscapeControls(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const Utf8Character first = FirstCharacter(text);
    if (first.valid && !IsControl(first.code)) {
      out += text.substr(0, first.bytes);
    } else {
      out += first.code < 0x100 ? fmt::format("\\x{:02x}", first.code)
                                : fmt::format("\\u{:04x}", first.code);
    }
    text.remove_prefix(first.bytes);
  }
  return out;
}

std::string EscapeMarkdown(std::string_view text) {
  constexpr std::string_view kMarks = "\\`*_[]|~#";
  std::string out;
  for (const char c : EscapeControls(text)) {
    if (c == '\n') {
      out += "\\\\n";
    } else if (kMarks.find(c) != std::string_view::npos) {
      out += {'\\', c};
    } else {
      const std::string_view entity = HtmlEntity(c);
      entity.empty() ? out += c : out += entity;
    }
  }
  return out;
}

std::string EscapeCsv(std::string_view text) {
  if (text.find_first_of(",\"\r\n") == std::string_view::npos) return std::string(text);
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + '"';
}

std::string EscapeHtml(std::string_view text) {
  std::string out;
  for (const char c : EscapeControls(text)) {
    const std::string_view entity = HtmlEntity(c);
    entity.empty() ? out += c : out += entity;
  }
  return out;
}

}  // namespace tilegrad
