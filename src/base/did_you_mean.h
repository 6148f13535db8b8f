// SPDX-License-Identifier: Apache-2.0
// What a person may have meant who has mistyped a name.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace tilegrad {

// Whether `word` is likely to mean `name`: a letter or two are otherwise, or one begins the other.
bool IsNear(std::string_view word, std::string_view name);

// " (did you mean --out?)" with the names, the nearest first, that `word` is likely to mean; empty
// if there is none.
std::string DidYouMean(std::string_view word, const std::vector<std::string>& known);

}  // namespace tilegrad
