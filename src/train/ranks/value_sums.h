// SPDX-License-Identifier: Apache-2.0
// Sums over portions of a few numbers of double precision, as losses are, in the order of the tree.
// Rank 0 gets those of all.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "train/ranks/division.h"
#include "train/ranks/transport.h"

namespace tilegrad::train {

class ValueSums {
 public:
  ValueSums(std::int64_t portions, Transport* ranks);

  void BeginUpdate() {
    subtree_ = 0;
    leaf_ = 0;
  }
  // Of each portion of this rank in turn; as many numbers every time, on every rank.
  void Add(std::span<const double> numbers);
  // On rank 0 the sums of all portions, else nothing. `meanwhile` as for Await; after a false the
  // result means nothing.
  std::span<const double> Finish(const std::function<bool()>& meanwhile);

 private:
  Transport* ranks_;  // null: this is the only one
  std::vector<Subtree> subtrees_, scratch_;
  std::vector<std::size_t> own_;                    // of subtrees_
  std::vector<std::vector<double>> rows_, levels_;  // of subtrees_; of the one in the making
  std::size_t subtree_ = 0;                         // in own_: where the next portion belongs
  std::int64_t leaf_ = 0;                           // which of its leaves
};

}  // namespace tilegrad::train
