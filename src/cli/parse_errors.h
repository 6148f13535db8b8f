// SPDX-License-Identifier: Apache-2.0
// What a person reads who has mistyped a command line.
#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <string>
#include <vector>

namespace tilegrad::cli {

// " (did you mean --out?)" with the known names that `word` is likely to mean; empty if none is.
std::string DidYouMean(const std::string& word, const std::vector<std::string>& known);

// The command that was chosen, what is wrong, and where its options are listed.
std::string ExplainParseError(const CLI::App* app, const CLI::Error& error);

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
