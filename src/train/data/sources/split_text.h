// SPDX-License-Identifier: Apache-2.0
// Lists of models are lines of columns, and columns may be lists themselves.
#pragma once

#include <string_view>
#include <vector>

namespace tilegrad::train {

// The parts of `text` between separators; views of it, one more than there are separators.
inline std::vector<std::string_view> SplitText(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (std::size_t end; (end = text.find(separator)) != std::string_view::npos;) {
    parts.push_back(text.substr(0, end));
    text.remove_prefix(end + 1);
  }
  parts.push_back(text);
  return parts;
}

}  // namespace tilegrad::train
