// SPDX-License-Identifier: Apache-2.0
// What a person reads who has mistyped a command line.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace tilegrad::cli {

// " (did you mean --out?)" with the known names that `word` is likely to mean; empty if none is.
std::string DidYouMean(const std::string& word, const std::vector<std::string>& known);

// The command that was chosen, what is wrong, and where its options are listed.
std::string ExplainParseError(const CLI::App* app, const CLI::Error& error);

}  // namespace tilegrad::cli
