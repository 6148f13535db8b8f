// SPDX-License-Identifier: Apache-2.0
#include "train/run/first_difference.h"

#include <fmt/format.h>

#include <sstream>

namespace tilegrad::train {

std::string FirstDifference(const std::string& was, const std::string& is) {
  std::istringstream old_lines(was), new_lines(is);
  for (std::string a, b;;) {
    const bool more_a = static_cast<bool>(std::getline(old_lines, a));
    const bool more_b = static_cast<bool>(std::getline(new_lines, b));
    if (!more_a && !more_b) return "";
    if (more_a && more_b && a == b) continue;
    const auto quoted = [](bool there, const std::string& line) {
      return there ? fmt::format("\"{}\"", line) : std::string("none");
    };
    return fmt::format("was {}, is {}", quoted(more_a, a), quoted(more_b, b));
  }
}

}  // namespace tilegrad::train
