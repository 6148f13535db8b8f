// SPDX-License-Identifier: Apache-2.0
#include "cli/did_you_mean.h"

#include <fmt/core.h>

#include <algorithm>
#include <numeric>

namespace tilegrad::cli {
namespace {

// Letters to insert, remove or replace.
std::size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

}  // namespace

std::string DidYouMean(const std::string& word, const std::vector<std::string>& known) {
  constexpr std::size_t kBegun = 4;  // letters, "--" among them, that are enough to tell
  constexpr std::size_t kMost = 3;   // that are named
  const std::size_t near = word.size() < kBegun ? 1 : 2;
  std::vector<std::pair<std::size_t, std::string>> found;  // nearest first
  for (const std::string& name : known) {
    const std::size_t both = std::min(word.size(), name.size()),
                      distance = EditDistance(word, name);
    const bool begins = both >= kBegun && word.compare(0, both, name, 0, both) == 0;
    if (begins || distance <= near) found.emplace_back(distance, name);
  }
  std::sort(found.begin(), found.end());
  std::string list;
  for (std::size_t i = 0; i < std::min(found.size(), kMost); ++i)
    list += (i == 0 ? "" : " or ") + found[i].second;
  return list.empty() ? "" : fmt::format(" (did you mean {}?)", list);
}

}  // namespace tilegrad::cli
