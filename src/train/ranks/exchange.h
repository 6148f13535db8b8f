// SPDX-License-Identifier: Apache-2.0
// Sums of all ranks, bucket by bucket, during the backward pass: each rank folds its piece of every
// bucket in the order of the tree and sends the total to the others. With one subtree each, a rank
// sends and receives 2 (R - 1) / R of the numbers; no sum depends on what arrives first.
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "base/aligned.h"
#include "train/ranks/division.h"
#include "train/ranks/transport.h"

namespace tilegrad::train {

class Exchange {
 public:
  // `ranks` outlives it. A separate thread moves the messages; it sleeps while there are none.
  Exchange(Transport& ranks, std::vector<Subtree> subtrees);
  ~Exchange();
  Exchange(const Exchange&) = delete;
  Exchange& operator=(const Exchange&) = delete;

  struct Job {
    const BucketLayout* layout = nullptr;
    std::vector<float*> own;  // sums of this rank's subtrees, layout->total() numbers each
    float* total = nullptr;   // of all, times `scale`
    float scale = 1;
  };
  // The memory belongs to the exchange until Wait returns true.
  void Begin(const Job& job);
  // The own sums of a bucket are final. Each bucket once.
  void Start(std::size_t bucket);
  // Sends this rank's piece of a bucket in `total`, whatever it holds by now, and receives the
  // others. Each bucket once, after Wait; from any thread.
  void Spread(std::size_t bucket);
  // Waits for this rank's pieces of the totals of all buckets; false if `meanwhile` returns false
  // first, which ends the exchange for good.
  bool Wait(const std::function<bool()>& meanwhile) { return Wait(meanwhile, 1); }
  // The same for what Spread brings.
  bool WaitForSpread(const std::function<bool()>& meanwhile) { return Wait(meanwhile, 2); }

 private:
  enum class Phase { kParts, kTotals, kDone };
  struct Moving {
    std::size_t bucket = 0;
    Phase phase = Phase::kParts;
    std::vector<Transport::Ticket> parts, rest;  // received parts; everything else
  };

  bool Wait(const std::function<bool()>& meanwhile, std::size_t rounds);
  void Run();
  bool Advance();
  bool Drop(std::vector<Transport::Ticket>* tickets);
  void Fold(std::size_t bucket);
  float* SumOf(std::size_t subtree, std::size_t bucket);
  Range Piece(std::size_t bucket, int rank) const {
    return PieceOf(job_.layout->bucket(bucket), rank, ranks_.size());
  }

  Transport& ranks_;
  const std::vector<Subtree> subtrees_;
  std::vector<Subtree> scratch_;
  std::vector<std::size_t> place_;  // of each subtree: which own sum, or which foreign one
  Job job_;
  std::size_t piece_numbers_ = 0;         // of this rank's pieces, all buckets
  std::vector<std::size_t> piece_begin_;  // where those of a bucket begin
  AlignedVector<float> foreign_;          // [foreign subtree][piece_numbers_]

  std::mutex mutex_;  // of all below
  std::condition_variable changed_;
  std::vector<Moving> moving_;
  std::size_t started_ = 0, done_ = 0;  // moves of buckets
  bool closing_ = false;
  std::thread thread_;
};

// Small and blocking exchanges over a Transport.

// Until it is done. Polls with pauses, which leave the core to others. `meanwhile`: called between
// polls; false ends the wait.
bool Await(Transport& ranks, Transport::Ticket ticket,
           const std::function<bool()>& meanwhile = nullptr);

void SendAndWait(Transport& ranks, const Address& to, std::span<const std::byte> data);
bool ReceiveAndWait(Transport& ranks, const Address& from, std::span<std::byte> data,
                    const std::function<bool()>& meanwhile = nullptr);  // false as of Await

// A trivially copyable value.
template <class T>
void SendValue(Transport& ranks, const Address& to, const T& value) {
  SendAndWait(ranks, to, std::as_bytes(std::span(&value, 1)));
}

template <class T>
T ReceiveValue(Transport& ranks, const Address& from) {
  T value{};
  ReceiveAndWait(ranks, from, std::as_writable_bytes(std::span(&value, 1)));
  return value;
}

// The bytes of rank 0 to all, along a tree; every rank calls it with as many bytes.
void Broadcast(Transport& ranks, std::span<std::byte> data);

// Every rank calls it; rank 0 gets the texts of all in order, the others nothing.
std::vector<std::string> GatherTexts(Transport& ranks, const std::string& own);

}  // namespace tilegrad::train
