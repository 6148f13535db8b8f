// SPDX-License-Identifier: Apache-2.0
// Internal to io: lines, tokens and numbers of the text formats, without copies.
#pragma once

#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "base/error.h"

namespace tilegrad::io {

inline std::string_view TextOf(std::span<const std::uint8_t> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// The text without a UTF-8 byte order mark.
inline std::string_view WithoutByteOrderMark(std::string_view text) {
  constexpr std::string_view kMark = "\xef\xbb\xbf";
  if (text.starts_with(kMark)) text.remove_prefix(kMark.size());
  return text;
}

// Iterates over lines; Number() is 1-based. The last line needs no line end; skips a UTF-8 byte
// order mark. `place` is what errors call the text.
class Lines {
 public:
  explicit Lines(std::string_view text, std::string place = {})
      : rest_(WithoutByteOrderMark(text)), place_(std::move(place)) {}

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
  const std::string& place() const { return place_; }
  // About the last line.
  template <class... A>
  Status Error(fmt::format_string<A...> format, A&&... arguments) const {
    return DataLoss("{}: line {}: {}", place_, number_,
                    fmt::format(format, std::forward<A>(arguments)...));
  }

 private:
  std::string_view rest_;
  std::string place_;
  std::size_t number_ = 0;
};

// An error for UTF-16 text, which says how to save the file.
inline Status CheckTextEncoding(std::string_view text, const std::string& place) {
  if (!text.starts_with("\xff\xfe") && !text.starts_with("\xfe\xff")) return {};
  return DataLoss("{}: text in UTF-16; save it as UTF-8", place);
}

// Space, \t, \n, \v, \f, \r.
constexpr bool IsWhiteSpace(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

// Loops, since find_first_of searches the set again for each character, and words are short.
inline std::string_view Trimmed(std::string_view text) {
  while (!text.empty() && IsWhiteSpace(text.front())) text.remove_prefix(1);
  while (!text.empty() && IsWhiteSpace(text.back())) text.remove_suffix(1);
  return text;
}

// Removes the next token (no white space) from the front of `rest` and returns it; empty at the
// end.
inline std::string_view NextToken(std::string_view& rest) {
  while (!rest.empty() && IsWhiteSpace(rest.front())) rest.remove_prefix(1);
  std::size_t end = 0;
  while (end < rest.size() && !IsWhiteSpace(rest[end])) ++end;
  const auto token = rest.substr(0, end);
  rest.remove_prefix(end);
  return token;
}

// Parses the whole token as a T, including "nan" and "inf", and "1.#QNAN" of old Windows programs
// as NaN. Accepts a leading '+'.
template <class T>
bool ParseAnyNumber(std::string_view token, T& value) {
  if constexpr (std::is_floating_point_v<T>) value = std::numeric_limits<T>::quiet_NaN();
  if (token.starts_with('+')) token.remove_prefix(1);
  const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), value);
  if (error == std::errc() && end == token.data() + token.size()) return true;
  if constexpr (std::is_floating_point_v<T>) {
    if (token.find(".#") == std::string_view::npos) return false;
    value = std::numeric_limits<T>::quiet_NaN();
    return true;
  }
  return false;
}

// The same for finite numbers.
template <class T>
bool ParseNumber(std::string_view token, T& value) {
  if (!ParseAnyNumber(token, value)) return false;
  if constexpr (std::is_floating_point_v<T>) return std::isfinite(value);
  return true;
}

// The value of a token of 1 to 9 digits, as most indices are; -1: it is another.
inline std::int32_t ShortNumber(std::string_view token) {
  if (token.empty() || token.size() > 9) return -1;
  std::int32_t value = 0;
  for (const char c : token) {
    if (c < '0' || c > '9') return -1;
    value = 10 * value + (c - '0');
  }
  return value;
}

}  // namespace tilegrad::io
