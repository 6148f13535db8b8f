// SPDX-License-Identifier: Apache-2.0
// How sums over portions and over long vectors are divided among ranks.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace tilegrad::train {

// The one order in which results of portions are summed: a binary tree, whichever rank holds which
// leaf. A rank owns neighbouring portions and sums the complete subtrees among them.

// Leaves [first, first + count) of the tree: count is a power of two that divides first.
struct Subtree {
  std::int64_t first = 0, count = 0;
  int owner = 0;  // rank
};

// All leaves, in order, each rank with as few subtrees as its leaves allow. Rank r of R has the
// portions [r P / R, (r + 1) P / R); R is at most P, a power of two.
std::vector<Subtree> SubtreesOf(int ranks, std::int64_t portions);

// Of leaves taken in order: leaf j of a subtree is added to its left neighbours of levels 0, 1, ..,
// climb - 1; the sum is kept at level `climb`, or is the subtree's if j is its last leaf.
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

// Where gradients lie in one long vector, and how it is cut into buckets, which travel by
// themselves.

struct Range {
  std::size_t begin = 0, end = 0;
  std::size_t size() const { return end - begin; }
};

class BucketLayout {
 public:
  // The last parameter comes first, as in a backward pass; `tail` numbers follow all. Buckets have
  // `bucket` numbers, the last one fewer: a large parameter lies in several and travels in parts.
  void Reset(std::span<const std::size_t> sizes, std::size_t tail, std::size_t bucket);

  std::size_t total() const { return tail_.end; }
  std::size_t parameters() const { return parameters_.size(); }
  Range parameter(std::size_t i) const { return parameters_[i]; }
  Range tail() const { return tail_; }
  std::size_t buckets() const { return parts_.size(); }
  Range bucket(std::size_t b) const { return {b * bucket_, std::min((b + 1) * bucket_, total())}; }
  // Those that hold some of a parameter, or of the tail.
  Range BucketsOf(const Range& part) const {
    if (part.size() == 0) return {};
    return {part.begin / bucket_, (part.end - 1) / bucket_ + 1};
  }
  // How many of these a bucket holds.
  std::size_t parts(std::size_t b) const { return parts_[b]; }

 private:
  std::vector<Range> parameters_;
  std::vector<std::size_t> parts_;
  Range tail_;
  std::size_t bucket_ = 1;
};

// The share of a bucket that a rank finishes the sum of.
inline Range PieceOf(const Range& bucket, int rank, int ranks) {
  const auto r = static_cast<std::size_t>(rank), n = static_cast<std::size_t>(ranks);
  return {bucket.begin + r * bucket.size() / n, bucket.begin + (r + 1) * bucket.size() / n};
}

}  // namespace tilegrad::train
