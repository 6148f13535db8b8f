// SPDX-License-Identifier: Apache-2.0
// Why a run cannot go on: what it was started with is kept as text, a line for each thing.
#pragma once

#include <fmt/format.h>

#include <sstream>
#include <string>

namespace tilegrad::train {

// The first line in which two such texts differ: was "rate = 1", is "rate = 2"; "" if they are
// equal. A line that one of them lacks is none.
inline std::string FirstDifference(const std::string& was, const std::string& is) {
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
