// SPDX-License-Identifier: Apache-2.0
#include "cli/command.h"

#include <algorithm>
#include <filesystem>

namespace tilegrad::cli {

// CLI11's own say "not in range 0 to 1797..." with 308 digits.
WordCheck AboveZero() {
  const auto fault = [](const std::string& word) {
    const auto number = RealNumber(word);
    return number && *number > 0 ? "" : word + " must be a number above 0";
  };
  return {fault, "above 0"};
}

WordCheck NotNegative() {
  const auto fault = [](const std::string& word) {
    const auto number = RealNumber(word);
    return number && *number >= 0 ? "" : word + " must be a number, 0 or above";
  };
  return {fault, "0 or above"};
}

WordCheck EndsIn(const std::string& ending) {
  const auto fault = [ending](const std::string& name) {
    const std::string given = LowerCase(std::filesystem::path(name).extension().string());
    return given.empty() || given == ending ? "" : name + ": it is written as " + ending;
  };
  return {fault, ""};
}

void Command::Add(const std::string& names, const Target& target, const std::string& text,
                  const std::vector<Trait>& traits) {
  options.push_back({names, target, text, traits});
}

bool Command::Given(const std::string& option) const {
  return std::any_of(options.begin(), options.end(),
                     [&](const Option& o) { return o.FirstName() == option && !o.words.empty(); });
}

}  // namespace tilegrad::cli
