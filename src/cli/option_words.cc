// SPDX-License-Identifier: Apache-2.0
#include "cli/option_words.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>

#include "cli/render_job.h"

namespace tilegrad::cli {
namespace {

bool IsNumber(const std::string& word) {
  double number = 0;
  return CLI::detail::lexical_cast(word, number);
}

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

void EndOptions(CLI::App& app) {
  for (CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    const auto options = command->get_options();
    const bool has_files = std::any_of(options.begin(), options.end(),
                                       [](const auto* option) { return option->get_positional(); });
    for (CLI::Option* option : options) {
      if (has_files && !option->get_positional()) option->allow_extra_args(false);
    }
  }
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
