// SPDX-License-Identifier: Apache-2.0
#include "base/did_you_mean.h"

#include <fmt/core.h>

#include <algorithm>
#include <numeric>

namespace tilegrad {
namespace {

// Letters to insert, remove or replace.
std::size_t EditDistance(std::string_view a, std::string_view b) {
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

bool IsNear(std::string_view word, std::string_view name) {
  constexpr std::size_t kBegun = 4;  // letters, "--" among them, that are enough to tell
  const std::size_t both = std::min(word.size(), name.size());
  if (both >= kBegun && word.substr(0, both) == name.substr(0, both)) return true;
  return EditDistance(word, name) <= (word.size() < kBegun ? 1 : 2);
}

std::string DidYouMean(std::string_view word, const std::vector<std::string>& known) {
  constexpr std::size_t kMost = 3;  // that are named
  std::vector<std::pair<std::size_t, std::string>> found;
  for (const std::string& name : known) {
    if (IsNear(word, name)) found.emplace_back(EditDistance(word, name), name);
  }
  std::sort(found.begin(), found.end());
  std::string list;
  for (std::size_t i = 0; i < std::min(found.size(), kMost); ++i)
    list += (i == 0 ? "" : " or ") + found[i].second;
  return list.empty() ? "" : fmt::format(" (did you mean {}?)", list);
}

}  // namespace tilegrad
