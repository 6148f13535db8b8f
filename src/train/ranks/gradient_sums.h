// SPDX-License-Identifier: Apache-2.0
// Sums over the portions of a batch, those of this process and of other ranks, in the order of one
// tree: of gradients and running statistics, and of losses.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "base/aligned.h"
#include "nn/tape.h"
#include "nn/tensor.h"
#include "train/ranks/division.h"
#include "train/ranks/exchange.h"
#include "train/ranks/transport.h"
#include "train/ranks/weight_share.h"

namespace tilegrad::train {

// Means of gradients and running statistics: those of this process are summed as they come, those
// of other ranks meanwhile.
class GradientSums : public nn::GradientListener {
 public:
  struct Shape {
    std::int64_t portions = 1;
    Transport* ranks = nullptr;                 // null: all portions are of this process
    std::size_t bucket = std::size_t{1} << 18;  // numbers that travel together
  };
  // `statistics` are changed by each portion (nn::Buffers); all tensors are of kF32.
  GradientSums(nn::Context& context, const Shape& shape, std::vector<nn::NamedTensor> statistics);

  // Of this process, ascending. Every update takes all of them in this order: BeginPortion, a
  // backward pass that this listens to, EndPortion; then Finish.
  const std::vector<std::int64_t>& portions() const { return portions_; }

  void BeginUpdate();
  void BeginPortion(std::size_t i);  // of portions(): the statistics are as the update found them
  void Begin(std::span<const nn::Var> parameters) override;
  void Ready(std::size_t i, const nn::Gradient& gradient) override;
  // Adds the statistics, and `gradients` if Ready did not receive them.
  void EndPortion(std::span<const nn::Gradient> gradients);
  // Waits for the other ranks; then means() are those of all portions, and so are the statistics.
  // False if `meanwhile`, called periodically, returns false first.
  bool Finish(const std::function<bool()>& meanwhile);
  // Null, or what an optimiser's step has to be given after each Finish. Then the means are those
  // of its pieces alone, and the statistics come when it has finished.
  WeightShare* share() { return share_.get(); }
  // After an error: the statistics are as the update found them.
  void GiveUp();

  std::span<const nn::Gradient> means() const { return means_; }
  double seconds_waited() const { return seconds_waited_; }  // in the last Finish
  std::size_t numbers() const { return layout_.total(); }    // that each portion has

 private:
  template <class Things>
  void LayOut(const Things& things);
  void Add(const float* from, const Range& range);
  void PartIsReady(const Range& part);
  void TakeTotals();
  void TakeOwn(const std::function<bool()>& meanwhile);
  void TakeStatistics(const float* totals, float scale);
  bool IsLastPortion() const { return at_ + 1 == portions_.size(); }
  void CopyStatistics(float* to);
  void SetStatistics(const float* from);

  nn::Context& context_;
  const Shape shape_;
  std::vector<nn::NamedTensor> statistics_;
  std::size_t statistics_numbers_ = 0;

  std::vector<Subtree> own_;
  std::vector<std::int64_t> portions_;
  std::vector<std::size_t> subtree_of_;  // of each of portions_, in own_

  BucketLayout layout_;
  bool laid_out_ = false, told_ = false;             // in this update; in this portion
  std::vector<std::size_t> sizes_, ready_;           // of parameters; ready parts of each bucket
  std::vector<AlignedVector<float>> levels_, sums_;  // of incomplete subtrees; of own_
  AlignedVector<float> total_, before_, after_;      // of all; statistics
  nn::StepVector<nn::Gradient> means_;
  std::size_t at_ = 0;  // which of portions_
  double seconds_waited_ = 0;
  std::unique_ptr<Exchange> exchange_;  // with other ranks
  std::unique_ptr<WeightShare> share_;
};

// Of a few numbers of double precision, as losses are. Rank 0 gets those of all.
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
  std::vector<std::vector<double>> rows_, levels_;  // of subtrees_; of the incomplete one
  std::size_t subtree_ = 0;                         // in own_: where the next portion belongs
  std::int64_t leaf_ = 0;                           // which of its leaves
};

}  // namespace tilegrad::train
