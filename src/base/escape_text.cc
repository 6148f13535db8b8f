// SPDX-License-Identifier: Apache-2.0
#include "base/escape_text.h"

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>

#include "base/escape_html.h"

namespace tilegrad {
namespace {

// The character at the beginning of a text: how many bytes it has, 1 and `valid` false where they
// are not UTF-8.
struct Utf8 {
  std::uint32_t code = 0;
  std::size_t bytes = 1;
  bool valid = false;
};

Utf8 FirstOf(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const std::uint8_t lead = byte(0);
  if (lead < 0x80) return {lead, 1, true};
  const std::size_t bytes = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  constexpr std::uint32_t kLeast[] = {0, 0, 0x80, 0x800, 0x10000};  // shorter would do below
  if (lead < 0xc2 || lead > 0xf4 || text.size() < bytes) return {lead};
  std::uint32_t code = lead & (0x7fu >> bytes);
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return {lead};
    code = code << 6 | (byte(i) & 0x3fu);
  }
  const bool surrogate = code >= 0xd800 && code <= 0xdfff;
  if (code < kLeast[bytes] || code > 0x10ffff || surrogate) return {lead};
  return {code, bytes, true};
}

bool IsControl(std::uint32_t code) {
  const bool layout = code == '\n' || code == '\t';
  const bool marks = code == 0x061c || (code >= 0x200e && code <= 0x200f) ||
                     (code >= 0x202a && code <= 0x202e) ||
                     (code >= 0x2066 && code <= 0x2069);  // of the direction of writing
  const bool breaks = code == 0x2028 || code == 0x2029;   // of lines and paragraphs
  return (code < 0x20 && !layout) || (code >= 0x7f && code < 0xa0) || marks || breaks;
}

}  // namespace

std::string EscapeControls(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const Utf8 first = FirstOf(text);
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

}  // namespace tilegrad
