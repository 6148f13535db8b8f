// SPDX-License-Identifier: Apache-2.0
// A list of items that ranks work on together, each on its own, and rank 0 gets what all made.
#pragma once

#include <cstddef>
#include <type_traits>
#include <vector>

#include "base/error.h"
#include "train/ranks/crew.h"
#include "train/ranks/messages.h"

namespace tilegrad::train {

class Share {
 public:
  // Blocks of so many items go to one rank after the other. `crew`: or null, then all are its own.
  explicit Share(Crew* crew, std::size_t block = 1) : crew_(crew), block_(block) {}

  bool Has(std::size_t item) const { return !crew_ || OwnerOf(item) == crew_->ranks().rank(); }

  // results: `width` of each item, as many on every rank. On rank 0 those of others come to their
  // places; an error of another rank is an error here.
  template <class T>
  Status Gather(std::vector<T>* results, std::size_t width = 1) const {
    static_assert(std::is_trivially_copyable_v<T>);
    if (!crew_) return {};
    Transport& ranks = crew_->ranks();
    if (!crew_->leads()) {
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
    return static_cast<int>(item / block_ % static_cast<std::size_t>(crew_->ranks().size()));
  }
  Status Receive(int peer, std::span<std::byte> data) const {
    Status alarm;
    ReceiveAndWait(crew_->ranks(), {peer, MessageKind::kBytes}, data,
                   [&] { return (alarm = crew_->Alarm()).ok(); });
    return alarm;
  }

  Crew* crew_;
  std::size_t block_;
};

}  // namespace tilegrad::train
