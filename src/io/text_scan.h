// SPDX-License-Identifier: Apache-2.0
// Internal to io: lines, tokens and numbers of the text formats, without copies.
#pragma once

#include <charconv>
#include <cmath>
#include <cstddef>
#include <string_view>
#include <type_traits>

namespace tilegrad::io {

// The text without UTF-8's byte order mark, if it begins with one.
inline std::string_view WithoutByteOrderMark(std::string_view text) {
  constexpr std::string_view kMark = "\xef\xbb\xbf";
  if (text.starts_with(kMark)) text.remove_prefix(kMark.size());
  return text;
}

// Walks over lines; Number() is 1-based. A last line needs no line end; UTF-8's byte order mark at
// the beginning is left out.
class Lines {
 public:
  explicit Lines(std::string_view text) : rest_(WithoutByteOrderMark(text)) {}

  bool Next(std::string_view& line) {
    if (rest_.empty()) return false;
    ++number_;
    const auto end = rest_.find('\n');
    line = rest_.substr(0, end);
    rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
    if (line.ends_with('\r')) line.remove_suffix(1);
    return true;
  }
  std::size_t Number() const { return number_; }
  std::string_view Rest() const { return rest_; }

 private:
  std::string_view rest_;
  std::size_t number_ = 0;
};

// Takes the next run of characters other than white space off `rest`; empty at the end.
inline std::string_view NextToken(std::string_view& rest) {
  constexpr std::string_view kSpace = " \t\r\n\v\f";
  const auto begin = rest.find_first_not_of(kSpace);
  if (begin == std::string_view::npos) return rest = {};
  auto end = rest.find_first_of(kSpace, begin);
  if (end == std::string_view::npos) end = rest.size();
  const auto token = rest.substr(begin, end - begin);
  rest.remove_prefix(end);
  return token;
}

// The whole token as a number of type T, a finite one; a leading '+' is fine.
template <class T>
bool ParseNumber(std::string_view token, T& value) {
  if (token.starts_with('+')) token.remove_prefix(1);
  const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), value);
  if (error != std::errc() || end != token.data() + token.size()) return false;
  if constexpr (std::is_floating_point_v<T>) return std::isfinite(value);
  return true;
}

}  // namespace tilegrad::io
