// SPDX-License-Identifier: Apache-2.0
// Checks of values, whose errors and help are sentences.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <map>
#include <string>

namespace tilegrad::cli {

// Refuses names that end otherwise: pic.jpg would be a PNG that programs take for something else.
// Names without an ending, as of devices, are fine.
inline CLI::Validator FileEnding(const std::string& ending) {
  const auto check = [ending](const std::string& name) {
    const std::string given = CLI::detail::to_lower(std::filesystem::path(name).extension());
    return given.empty() || given == ending ? std::string() : name + ": it is written as " + ending;
  };
  return {check, ""};
}

// CLI11's own say "not in range 0 to 1797..." with 308 digits.
inline CLI::Validator AboveZero() {
  const auto check = [](const std::string& word) {
    double value = 0;
    const bool good = CLI::detail::lexical_cast(word, value) && value > 0;
    return good ? std::string() : word + " must be a number above 0";
  };
  return {check, "above 0"};
}

inline CLI::Validator NotNegative() {
  const auto check = [](const std::string& word) {
    double value = 0;
    const bool good = CLI::detail::lexical_cast(word, value) && value >= 0;
    return good ? std::string() : word + " must be a number, 0 or above";
  };
  return {check, "0 or above"};
}

// Shows names of choices in errors as in the help, without the numbers behind them.
template <class T>
CLI::Validator OneOf(const std::map<std::string, T>& choices) {
  std::string names;
  for (const auto& [name, _] : choices) names += (names.empty() ? "" : ",") + name;
  const auto check = [choices, names](std::string& word) {
    const auto found = choices.find(CLI::detail::to_lower(word));
    if (found == choices.end()) return word + " is not one of " + names;
    word = std::to_string(static_cast<int>(found->second));
    return std::string();
  };
  return CLI::Validator(check, "{" + names + "}");
}

}  // namespace tilegrad::cli
