// SPDX-License-Identifier: Apache-2.0
// Letters and characters of text.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace tilegrad {

// ASCII's capital letters made small, as names of formats and endings are compared.
std::string LowerCase(std::string_view text);

// Appends a character of Unicode as UTF-8; U+FFFD for what is none (surrogates, above U+10FFFF).
void AppendUtf8(std::uint32_t character, std::string* out);

}  // namespace tilegrad
