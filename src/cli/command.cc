// SPDX-License-Identifier: Apache-2.0
#include "cli/command.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <sstream>

namespace tilegrad::cli {

// std::from_chars would refuse a plus sign, "0x" and white space before the number.
std::optional<double> RealNumber(const std::string& word) {
  char* end = nullptr;
  const double number = std::strtod(word.c_str(), &end);
  if (word.empty() || end != word.c_str() + word.size()) return std::nullopt;
  return number;
}

std::vector<std::string> PartsBetweenCommas(const std::string& text) {
  std::vector<std::string> parts;
  std::istringstream rest(text);
  for (std::string part; std::getline(rest, part, ',');) parts.push_back(part);
  return parts;
}

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
    return given.empty() || given == ending ? "" : name + ": the file must end in " + ending;
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
