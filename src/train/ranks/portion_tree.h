// SPDX-License-Identifier: Apache-2.0
// The one order in which what portions give is summed: a binary tree over them, whoever holds the
// leaves. A rank owns portions that lie side by side; it sums the complete subtrees among them, and
// the rest of the tree is summed from those.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace tilegrad::train {

// Leaves [first, first + count) of the tree: count is a power of two that divides first.
struct Subtree {
  std::int64_t first = 0, count = 0;
  int owner = 0;  // rank
};

// All leaves, in order, each rank with as few subtrees as its leaves allow. Rank r of R has the
// portions [r P / R, (r + 1) P / R); R is at most P, a power of two.
std::vector<Subtree> SubtreesOf(int ranks, std::int64_t portions);

// Takes leaves in order and says where their sums go: leaf j of a subtree meets the sums of `climb`
// left neighbours, of levels 0, 1, .., climb - 1, and the result is kept at level `climb`, or is
// the subtree's if j is its last leaf.
inline std::size_t ClimbOf(std::int64_t j) {
  return static_cast<std::size_t>(std::countr_one(static_cast<std::uint64_t>(j)));
}

// Merges subtrees, in order, to the sum of all. add(a, b): sum a += sum b, of subtrees a < b by
// their numbers; in the end that of subtree 0 is the sum of all.
template <class Add>
void FoldSubtrees(const std::vector<Subtree>& subtrees, std::vector<Subtree>* scratch, Add add) {
  std::vector<Subtree>& open = *scratch;  // Subtree::owner: the number where the sum is
  open.clear();
  for (std::size_t i = 0; i < subtrees.size(); ++i) {
    open.push_back({subtrees[i].first, subtrees[i].count, static_cast<int>(i)});
    while (open.size() > 1) {
      Subtree &left = open[open.size() - 2], &right = open.back();
      if (left.count != right.count || left.first % (2 * left.count) != 0) break;
      add(static_cast<std::size_t>(left.owner), static_cast<std::size_t>(right.owner));
      left.count *= 2;
      open.pop_back();
    }
  }
}

}  // namespace tilegrad::train
