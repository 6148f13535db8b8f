// SPDX-License-Identifier: Apache-2.0
// An optimiser's step shared out over ranks: each moves the weights whose gradients it has the sums
// of (PieceOf), and sends these weights to all others, where else it would send sums. Moments of a
// weight are up to date on that rank alone, until they are gathered.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <vector>

#include "nn/optim.h"
#include "train/ranks/division.h"
#include "train/ranks/exchange.h"

namespace tilegrad::train {

class WeightShare : public nn::UpdateShare {
 public:
  // All outlive it.
  WeightShare(Transport& ranks, const Workers& workers, Exchange& exchange)
      : ranks_(ranks), workers_(workers), exchange_(exchange) {}

  struct Job {
    const BucketLayout* layout = nullptr;
    float* numbers = nullptr;         // of the layout; this rank's pieces hold sums, then weights
    std::function<bool()> meanwhile;  // of Exchange::Wait
    std::function<void()> arrived;    // called when the numbers of all ranks have arrived
  };
  // Before an optimiser's step, when the sums are complete.
  void Prepare(Job job);
  // What this rank moves, in the numbering of the layout: use(piece, where it lies in `numbers`).
  template <class Use>
  void ForOwn(Use use) const {
    for (std::size_t k = 0; k < own_.size(); ++k) use(own_[k].piece, own_[k].flat);
  }

  void Begin(const nn::Adam& adam) override;
  std::size_t pieces() const override { return own_.size(); }
  Piece piece(std::size_t k) const override { return own_[k].piece; }
  void Updated(std::size_t k) override;
  Status Finish() override;

  bool finished() const { return finished_; }                // no step is due
  double seconds_waited() const { return seconds_waited_; }  // in the last Finish

  // Whether moments are spread over ranks: the same on all of them.
  bool HasMoments() const { return !spread_.empty(); }
  // Every rank calls it; afterwards rank 0 has all moments.
  void GatherMoments();

 private:
  struct Place {
    Piece piece;
    std::size_t flat = 0, bucket = 0;
  };
  static void PlacesOf(const BucketLayout& layout, int rank, int ranks, std::vector<Place>* out);
  struct Spread {
    const nn::Adam* adam;
    BucketLayout layout;
  };
  void GatherMoment(const Spread& spread, std::size_t moment);

  Transport& ranks_;
  const Workers& workers_;
  Exchange& exchange_;
  Job job_;
  std::vector<Place> own_, foreign_;
  std::unique_ptr<std::atomic<int>[]> left_;  // of each bucket: own pieces that are to come
  std::size_t left_size_ = 0;
  const nn::Adam* adam_ = nullptr;
  bool finished_ = true;
  double seconds_waited_ = 0;
  std::vector<Spread> spread_;
};

}  // namespace tilegrad::train
