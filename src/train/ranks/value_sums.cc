// SPDX-License-Identifier: Apache-2.0
#include "train/ranks/value_sums.h"

#include "train/ranks/messages.h"

namespace tilegrad::train {

ValueSums::ValueSums(std::int64_t portions, Transport* ranks)
    : ranks_(ranks), subtrees_(SubtreesOf(ranks ? ranks->size() : 1, portions)) {
  std::size_t levels = 0;
  for (std::size_t i = 0; i < subtrees_.size(); ++i) {
    if (subtrees_[i].owner != (ranks ? ranks->rank() : 0)) continue;
    own_.push_back(i);
    levels = std::max(levels, ClimbOf(subtrees_[i].count - 1));
  }
  rows_.resize(subtrees_.size());
  levels_.resize(levels);
}

void ValueSums::Add(std::span<const double> numbers) {
  const std::size_t at = own_[subtree_], climb = ClimbOf(leaf_);
  const bool last = leaf_ + 1 == subtrees_[at].count;
  std::vector<double>& to = last ? rows_[at] : levels_[climb];
  to.assign(numbers.begin(), numbers.end());
  for (std::size_t level = 0; level < climb; ++level) {
    for (std::size_t i = 0; i < to.size(); ++i) to[i] = levels_[level][i] + to[i];
  }
  leaf_ = last ? 0 : leaf_ + 1;
  subtree_ += last ? 1 : 0;
}

std::span<const double> ValueSums::Finish(const std::function<bool()>& meanwhile) {
  const std::size_t numbers = rows_[own_[0]].size();
  for (std::size_t i = 0; i < subtrees_.size(); ++i) {
    const int owner = subtrees_[i].owner;
    const int me = ranks_ ? ranks_->rank() : 0;
    if (me > 0 && owner == me)
      SendAndWait(*ranks_, {0, MessageKind::kValues}, std::as_bytes(std::span(rows_[i])));
    if (me > 0 || owner == 0) continue;
    rows_[i].resize(numbers);
    const auto ticket =
        ranks_->Receive({owner, MessageKind::kValues}, std::as_writable_bytes(std::span(rows_[i])));
    if (!Await(*ranks_, ticket, meanwhile)) return {};
  }
  if (ranks_ && ranks_->rank() > 0) return {};
  FoldSubtrees(subtrees_, &scratch_, [&](std::size_t left, std::size_t right) {
    for (std::size_t k = 0; k < numbers; ++k) rows_[left][k] += rows_[right][k];
  });
  return rows_[0];
}

}  // namespace tilegrad::train
