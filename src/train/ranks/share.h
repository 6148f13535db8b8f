// SPDX-License-Identifier: Apache-2.0
// A list of items that ranks work on together, each on its own, and rank 0 gets what all made.
#pragma once

#include <cstddef>
#include <type_traits>
#include <vector>

#include "base/error.h"
#include "train/ranks/messages.h"
#include "train/ranks/process_group.h"

namespace tilegrad::train {

class Share {
 public:
  // Blocks of so many items go to one rank after the other. `group`: or null, then all are its own.
  explicit Share(ProcessGroup* group, std::size_t block = 1) : group_(group), block_(block) {}

  bool Has(std::size_t item) const { return !group_ || OwnerOf(item) == group_->ranks().rank(); }

  // results: `width` of each item, as many on every rank. On rank 0 those of others come to their
  // places; an error of another rank is an error here.
  template <class T>
  Status Gather(std::vector<T>* results, std::size_t width = 1) const {
    static_assert(std::is_trivially_copyable_v<T>);
    if (!group_) return {};
    Transport& ranks = group_->ranks();
    if (!group_->leads()) {
      SendAndWait(ranks, {0, MessageKind::kBytes}, std::as_bytes(std::span(*results)));
      return {};
    }
    std::vector<T> theirs(results->size());
    for (int peer = 1; peer < ranks.size(); ++peer) {
      TILEGRAD_TRY(Receive(peer, std::as_writable_bytes(std::span(theirs))));
      for (std::size_t i = 0; i < theirs.size(); ++i) {
        if (OwnerOf(i / width) == peer) (*results)[i] = theirs[i];
      }
    }
    return {};
  }

 private:
  int OwnerOf(std::size_t item) const {
    return static_cast<int>(item / block_ % static_cast<std::size_t>(group_->ranks().size()));
  }
  Status Receive(int peer, std::span<std::byte> data) const {
    Status error;
    ReceiveAndWait(group_->ranks(), {peer, MessageKind::kBytes}, data,
                   [&] { return (error = group_->ReportedError()).ok(); });
    return error;
  }

  ProcessGroup* group_;
  std::size_t block_;
};

}  // namespace tilegrad::train
