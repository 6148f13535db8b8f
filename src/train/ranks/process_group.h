// SPDX-License-Identifier: Apache-2.0
// The ranks of one run: rank 0 leads, writes all files and starts each step; the others follow. An
// error on any rank is reported once, by rank 0.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <type_traits>
#include <vector>

#include "base/error.h"
#include "nn/tensor.h"
#include "tilegrad/status.h"
#include "train/ranks/exchange.h"
#include "train/ranks/transport.h"

namespace tilegrad::train {

// A property that must be equal on all ranks: name ("build", ...), value, and advice if it is not.
struct Trait {
  std::string name, value, advice;
};

class ProcessGroup {
 public:
  explicit ProcessGroup(Transport& ranks);

  Transport& ranks() { return ranks_; }
  bool leads() const { return ranks_.rank() == 0; }

  // Every rank calls it with its status so far. If one failed, or its traits differ from rank 0's,
  // the leader gets an error that names rank and host, and the others kCancelled.
  Status Agree(const Status& own, const std::vector<Trait>& traits);

  // The leader's tensors to all; every rank calls it with tensors of the same names and shapes.
  void Share(std::vector<nn::NamedTensor>* tensors);

  // Leader: one message to all others. Follower: waits for it.
  void Order(std::int64_t order);
  std::int64_t AwaitOrder();

  // Follower: sends an error in the middle of a step to the leader.
  void TellLeader(const Status& status);
  // The same, then waits for the end of all ranks.
  [[noreturn]] void ReportError(const Status& status);
  // Leader: the error that a follower sent, if any; it names the rank.
  Status ReportedError();
  // Leader: a step failed, so followers wait in vain. After reporting it, end all ranks by
  // Transport::Abort.
  void Break() { broken_ = true; }
  bool broken() const { return broken_; }

  // Every rank calls it at the end, unless it is broken.
  void Shutdown();

 private:
  using ErrorText = std::array<char, 1024>;  // empty: no error
  Transport& ranks_;
  bool broken_ = false;
  std::vector<ErrorText> errors_;  // leader: of each follower
  std::vector<Transport::Ticket> tickets_;
  std::vector<bool> reported_;
};

// The traits that every task has: this program's file, the instruction set, the configuration.
std::vector<Trait> CommonTraits(const std::string& settings);

// A list of items that ranks work on together, each on its own, and rank 0 gets what all made.

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
