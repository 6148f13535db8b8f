// SPDX-License-Identifier: Apache-2.0
#include "io/fbx_wrapping.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstring>
#include <string_view>

namespace tilegrad::io {
namespace {

constexpr std::string_view kName = "WrapMode";  // and U or V

// Behind the name in a text: `", "enum", "", "",1` to the end of the line.
int TextValue(std::string_view rest) {
  rest = rest.substr(0, rest.find_first_of("\r\n"));
  const std::size_t comma = rest.rfind(',');
  if (comma == std::string_view::npos) return 0;
  rest.remove_prefix(std::min(rest.find_first_not_of(" \t", comma + 1), rest.size()));
  int value = 0;
  std::from_chars(rest.data(), rest.data() + rest.size(), value);
  return value;
}

// Behind the name in a binary: three texts, S with 32 bits of length, then I and the value.
int BinaryValue(std::string_view rest) {
  const auto number = [&]() {
    std::uint32_t value = 0;
    std::memcpy(&value, rest.data() + 1, sizeof(value));
    if constexpr (std::endian::native == std::endian::big) value = __builtin_bswap32(value);
    return value;
  };
  constexpr std::size_t kHead = 1 + sizeof(std::uint32_t);
  for (int text = 0; text < 3; ++text) {
    if (rest.size() < kHead || rest[0] != 'S' || number() > rest.size() - kHead) return 0;
    rest.remove_prefix(kHead + number());
  }
  return rest.size() < kHead || rest[0] != 'I' ? 0 : static_cast<int>(number());
}

}  // namespace

bool HasClampedFbxTexture(std::span<const std::uint8_t> file) {
  const std::string_view all(reinterpret_cast<const char*>(file.data()), file.size());
  for (std::size_t at = all.find(kName); at < all.size(); at = all.find(kName, at + 1)) {
    std::string_view rest = all.substr(at + kName.size());
    if (!rest.starts_with('U') && !rest.starts_with('V')) continue;
    rest.remove_prefix(1);
    if ((rest.starts_with('"') ? TextValue(rest) : BinaryValue(rest)) != 0) return true;
  }
  return false;
}

}  // namespace tilegrad::io
