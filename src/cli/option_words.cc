// SPDX-License-Identifier: Apache-2.0
#include "cli/option_words.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdlib>
#include <sstream>
#include <string_view>

#include "cli/render_job.h"

namespace tilegrad::cli {
namespace {

bool IsNumber(const std::string& word) { return RealNumber(word).has_value(); }

bool IsOutput(const std::string& word) {
  return std::find(kOutputNames.begin(), kOutputNames.end(), word) != kOutputNames.end();
}

// NAME=NUMBER
bool IsRate(const std::string& word) {
  const std::size_t equals = word.find('=');
  return equals != std::string::npos && IsNumber(word.substr(equals + 1));
}

struct List {
  std::string_view option;
  bool (*is_value)(const std::string& word);
  std::size_t count;  // words that are wanted; 0: as many as there are
};
constexpr std::array kLists = {
    List{"--up", IsNumber, 3},      List{"--errors", IsNumber, 0},
    List{"--deltas", IsNumber, 0},  List{"--training-errors", IsNumber, 0},
    List{"--outputs", IsOutput, 0}, List{"--rate", IsRate, 0},
};

// How many of the words from `first` on are values of the list.
template <class Word>
std::size_t CountValues(const List& list, Word first, Word end) {
  const auto last = std::find_if_not(first, end, list.is_value);
  const auto count = static_cast<std::size_t>(last - first);
  return list.count == 0 ? count : count < list.count ? 0 : list.count;
}

}  // namespace

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

std::vector<std::string> JoinLists(std::vector<std::string> words) {
  for (std::size_t i = 0; i + 2 < words.size(); ++i) {
    const auto list = std::find_if(kLists.begin(), kLists.end(),
                                   [&](const List& l) { return l.option == words[i]; });
    if (list == kLists.end()) continue;
    const auto first = words.begin() + static_cast<std::ptrdiff_t>(i) + 1;
    const auto end = first + static_cast<std::ptrdiff_t>(CountValues(*list, first, words.end()));
    if (end - first < 2) continue;
    for (auto word = first + 1; word != end; ++word) *first += "," + *word;
    words.erase(first + 1, end);
  }
  return words;
}

}  // namespace tilegrad::cli
