// SPDX-License-Identifier: Apache-2.0
#include "train/ranks/placement.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "base/parallel.h"

namespace tilegrad::train {
namespace {

// "0-3,8-11": empty if it is not of that form.
Cores CoresIn(std::string_view list) {
  Cores out;
  const char *at = list.data(), *const end = at + list.size();
  while (at < end && *at != '\n') {
    int first = 0, last = 0;
    auto number = std::from_chars(at, end, first);
    if (number.ec != std::errc()) return {};
    last = first;
    if (number.ptr < end && *number.ptr == '-') {
      number = std::from_chars(number.ptr + 1, end, last);
      if (number.ec != std::errc()) return {};
    }
    if (first < 0 || last < first || last >= kMostCores) return {};
    for (int core = first; core <= last; ++core) out.push_back(core);
    at = number.ptr < end && *number.ptr == ',' ? number.ptr + 1 : number.ptr;
    if (at == number.ptr && at < end && *at != '\n') return {};
  }
  return out;
}

}  // namespace

std::vector<Cores> NumaNodes(const Path& folder) {
  std::vector<Cores> nodes;
  for (int node = 0;; ++node) {
    const auto list = ReadText(folder / fmt::format("node{}", node) / "cpulist");
    if (!list.ok()) return nodes;
    Cores cores = CoresIn(*list);
    if (!cores.empty()) nodes.push_back(std::move(cores));  // a node may be memory alone
  }
}

RankPlace PlaceOf(std::span<const Cores> nodes, int local, int ranks) {
  const int count = static_cast<int>(nodes.size());
  const auto first_node = [&](int rank) { return rank * count / ranks; };
  const int first = first_node(local), end = std::max(first + 1, first_node(local + 1));
  RankPlace out;
  for (int node = first; node < end; ++node) {
    const Cores& cores = nodes[static_cast<std::size_t>(node)];
    out.cores.insert(out.cores.end(), cores.begin(), cores.end());
  }
  int sharing = 0;
  for (int rank = 0; rank < ranks; ++rank) sharing += first_node(rank) == first ? 1 : 0;
  out.workers = std::max(1, static_cast<int>(out.cores.size()) / sharing);
  return out;
}

}  // namespace tilegrad::train
