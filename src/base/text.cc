// SPDX-License-Identifier: Apache-2.0
#include "base/text.h"

#include <algorithm>
#include <charconv>

namespace tilegrad {

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

}  // namespace tilegrad
