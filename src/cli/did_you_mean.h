// SPDX-License-Identifier: Apache-2.0
// What a person may have meant who has mistyped a command line.
#pragma once

#include <string>
#include <vector>

namespace tilegrad::cli {

// " (did you mean --out?)" with the known names that `word` is likely to mean; empty if none is.
std::string DidYouMean(const std::string& word, const std::vector<std::string>& known);

}  // namespace tilegrad::cli
