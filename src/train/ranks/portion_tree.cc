// SPDX-License-Identifier: Apache-2.0
#include "train/ranks/portion_tree.h"

namespace tilegrad::train {

std::vector<Subtree> SubtreesOf(int ranks, std::int64_t portions) {
  std::vector<Subtree> out;
  for (int rank = 0; rank < ranks; ++rank) {
    const std::int64_t end = (rank + 1) * portions / ranks;
    for (std::int64_t at = rank * portions / ranks; at < end; at += out.back().count) {
      std::int64_t count = 1;
      while (at % (2 * count) == 0 && at + 2 * count <= end) count *= 2;
      out.push_back({at, count, rank});
    }
  }
  return out;
}

}  // namespace tilegrad::train
