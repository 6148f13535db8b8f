// SPDX-License-Identifier: Apache-2.0
// What the words of a command line say, and lists of several words.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace tilegrad::cli {

// The number that all of the word is, as CLI11 reads options: also "+.5", "0x10", "inf" and "nan".
std::optional<double> RealNumber(const std::string& word);

// "a,b" is a and b.
std::vector<std::string> PartsBetweenCommas(const std::string& text);

// Lists whose words stand apart, in the words of a command line, joined by commas: those that are
// of the list's kind. "--errors 0 1e-3 mesh.obj" becomes "--errors 0,1e-3 mesh.obj"; the same for
// --up of three numbers, which may also be a word.
std::vector<std::string> JoinLists(std::vector<std::string> words);

}  // namespace tilegrad::cli
