// SPDX-License-Identifier: Apache-2.0
// The ranks of one run as a crew: rank 0 leads, it alone writes files and says when a step is
// taken; the others follow. What goes wrong anywhere is said once, by rank 0.
#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "nn/tensor.h"
#include "tilegrad/status.h"
#include "train/ranks/transport.h"

namespace tilegrad::train {

// What must be equal on all ranks: name ("build", ...), value, and what to do where it is not.
struct Trait {
  std::string name, value, advice;
};

class Crew {
 public:
  explicit Crew(Transport& ranks);

  Transport& ranks() { return ranks_; }
  bool leads() const { return ranks_.rank() == 0; }

  // Every rank calls it, with how it fared so far. Where one failed, or its traits are not those of
  // rank 0, the leader gets an error that names rank and host, and the others kCancelled: the
  // leader speaks for them.
  Status Agree(const Status& own, const std::vector<Trait>& traits);

  // The leader's tensors to all; every rank calls it with tensors of the same names and shapes.
  void Share(std::vector<nn::NamedTensor>* tensors);

  // Leader: one message to all others. Follower: waits for it.
  void Order(std::int64_t order);
  std::int64_t AwaitOrder();

  // Follower: tells the leader of an error in the middle of a step.
  void TellLeader(const Status& status);
  // The same, then waits for the end of all ranks.
  [[noreturn]] void RaiseAlarm(const Status& status);
  // Leader: whether somebody did; the error names the rank.
  Status Alarm();
  // Leader: a step failed, so that followers wait for what will not come. Whoever has said why ends
  // all ranks by Transport::Abort.
  void Break() { broken_ = true; }
  bool broken() const { return broken_; }

  // Every rank calls it at the end, unless it is broken.
  void Disband();

 private:
  using AlarmText = std::array<char, 1024>;  // empty: all is well
  Transport& ranks_;
  bool broken_ = false;
  std::vector<AlarmText> alarms_;  // leader: of each follower
  std::vector<Transport::Ticket> tickets_;
  std::vector<bool> rung_;
};

// The traits that every task has: this program's file, the instruction set, the configuration.
std::vector<Trait> CommonTraits(const std::string& settings);

}  // namespace tilegrad::train
