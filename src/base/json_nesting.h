// SPDX-License-Identifier: Apache-2.0
// Guards against deeply nested JSON: the parser, and any code that copies or writes the values,
// recurses as deep as they are nested.
#pragma once

#include <cstddef>
#include <string_view>

namespace tilegrad {

// The position of the first bracket nested within `most` others; npos if there is none. The text
// need not be valid.
inline std::size_t FirstNestedDeeper(std::string_view json, int most) {
  int depth = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const char c = json[i];
    if (c == '"') {
      quoted = !quoted;
    } else if (quoted) {
      i += c == '\\' ? 1 : 0;
    } else if (c == '{' || c == '[') {
      if (++depth > most) return i;
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
  return std::string_view::npos;
}

}  // namespace tilegrad
