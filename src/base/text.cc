// SPDX-License-Identifier: Apache-2.0
#include "base/text.h"

#include <fmt/core.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <numeric>

namespace tilegrad {
namespace {

constexpr std::uint32_t kByte = 0xEF00;  // plus the byte: the character that encodes it

bool StandsForByte(const Utf8Character& c) {
  return c.valid && c.code >= kByte + 0x80 && c.code <= kByte + 0xFF;
}

// Letters to insert, remove or replace.
std::size_t EditDistance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

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

std::string LowerCase(std::string_view text) {
  std::string lower(text);
  std::ranges::transform(lower, lower.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return lower;
}

std::string Plural(std::string_view thing, bool one) {
  return std::string(thing) + (one ? "" : thing.ends_with('s') ? "es" : "s");
}

std::string DecodePercent(std::string_view uri) {
  constexpr std::size_t kDigits = 2;
  std::string out;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const std::string_view digits = uri.substr(i + 1, kDigits);
    unsigned code = 0;
    const auto end = std::from_chars(digits.data(), digits.data() + digits.size(), code, 16).ptr;
    const bool coded = uri[i] == '%' && end == digits.data() + kDigits;
    out += coded ? static_cast<char>(code) : uri[i];
    if (coded) i += kDigits;
  }
  return out;
}

void AppendUtf8(std::uint32_t character, std::string* out) {
  if (character > 0x10FFFF || (character >= 0xD800 && character < 0xE000)) character = 0xFFFD;
  const int more = character < 0x80 ? 0 : character < 0x800 ? 1 : character < 0x10000 ? 2 : 3;
  constexpr std::uint32_t kFirst[] = {0, 0xC0, 0xE0, 0xF0};  // the marks of the first byte
  out->push_back(static_cast<char>(kFirst[more] | character >> 6 * more));
  for (int left = more - 1; left >= 0; --left)
    out->push_back(static_cast<char>(0x80 | (character >> 6 * left & 0x3F)));
}

Utf8Character FirstCharacter(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const std::uint8_t lead = byte(0);
  if (lead < 0x80) return {lead, 1, true};
  const std::size_t bytes = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  constexpr std::uint32_t kLeast[] = {0, 0, 0x80, 0x800, 0x10000};  // overlong below
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

bool IsUtf8(std::string_view text) {
  while (!text.empty()) {
    const Utf8Character first = FirstCharacter(text);
    if (!first.valid) return false;
    text.remove_prefix(first.bytes);
  }
  return true;
}

std::string JsonName(std::string_view name) {
  std::string out;
  while (!name.empty()) {
    const Utf8Character first = FirstCharacter(name);
    const std::string_view bytes = name.substr(0, first.bytes);
    if (first.valid && !StandsForByte(first)) {
      out += bytes;
    } else {
      for (const char c : bytes) AppendUtf8(kByte + static_cast<std::uint8_t>(c), &out);
    }
    name.remove_prefix(first.bytes);
  }
  return out;
}

std::string NameFromJson(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const Utf8Character first = FirstCharacter(text);
    if (StandsForByte(first)) {
      out += static_cast<char>(first.code - kByte);
    } else {
      out += text.substr(0, first.bytes);
    }
    text.remove_prefix(first.bytes);
  }
  return out;
}

bool IsNear(std::string_view word, std::string_view name) {
  constexpr std::size_t kBegun = 4;  // enough letters for a prefix, "--" included
  const std::size_t both = std::min(word.size(), name.size());
  if (both >= kBegun && word.substr(0, both) == name.substr(0, both)) return true;
  return EditDistance(word, name) <= (word.size() < kBegun ? 1 : 2);
}

std::string DidYouMean(std::string_view word, const std::vector<std::string>& known) {
  constexpr std::size_t kMost = 3;  // suggestions shown
  std::vector<std::pair<std::size_t, std::string>> found;
  for (const std::string& name : known) {
    if (IsNear(word, name)) found.emplace_back(EditDistance(word, name), name);
  }
  std::sort(found.begin(), found.end());
  std::string list;
  for (std::size_t i = 0; i < std::min(found.size(), kMost); ++i)
    list += (i == 0 ? "" : " or ") + found[i].second;
  return list.empty() ? "" : fmt::format(" (did you mean {}?)", list);
}

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

std::string ShellWord(std::string_view text) {
  constexpr std::string_view kSafe =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-./=:,+@%";
  if (!text.empty() && text.find_first_not_of(kSafe) == std::string_view::npos)
    return std::string(text);
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
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
