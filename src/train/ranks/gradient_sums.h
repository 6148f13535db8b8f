// SPDX-License-Identifier: Apache-2.0
// Sums over the portions of a batch, those of this process and of other ranks, in the order of one
// tree: of gradients and running statistics, and of losses.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
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

// Means of gradients and running statistics. Lanes divide the portions of this process as ranks
// divide those of a run: each sums its own, then the lanes' sums are added in the order of the
// tree. With one lane the exchange with other ranks overlaps the last portion's backward pass; with
// several it follows them. Without other ranks a gradient that is a product stays one: the factors
// of all portions are stacked, and Adam sums products where it uses them.
class GradientSums {
 public:
  struct Shape {
    std::int64_t portions = 1;
    Transport* ranks = nullptr;                 // null: all portions are of this process
    std::size_t bucket = std::size_t{1} << 18;  // numbers that travel together
  };
  // `statistics` are changed by each portion (nn::Buffers); all tensors are of kF32.
  GradientSums(nn::Context& context, const Shape& shape, std::vector<nn::NamedTensor> statistics);
  ~GradientSums();
  GradientSums(const GradientSums&) = delete;
  GradientSums& operator=(const GradientSums&) = delete;

  // The most lanes that have portions of this rank.
  static std::size_t MostLanes(const Shape& shape);

  // The portions of a lane, and their sums.
  class Lane : public nn::GradientListener {
   public:
    Lane(GradientSums& all, std::vector<Subtree> subtrees);
    // Ascending. Every update runs, in the lane and for each of them in this order, BeginPortion, a
    // backward pass with listener(), and EndPortion.
    const std::vector<std::int64_t>& portions() const { return portions_; }
    // This object with other ranks; null without, when early gradients are of no use.
    nn::GradientListener* listener() { return all_.exchange_ ? this : nullptr; }
    void BeginPortion(std::size_t i);  // of portions(): statistics are as the update found them
    void Begin(std::span<const nn::Var> parameters) override;
    void Ready(std::size_t i, const nn::Gradient& gradient) override;
    // Adds the statistics, and `gradients` if Ready did not receive them.
    void EndPortion(std::span<const nn::Gradient> gradients);

   private:
    friend class GradientSums;
    template <class Things>
    void LayOut(const Things& things);
    void Take(std::size_t i, const nn::Gradient& gradient);
    void Add(const float* from, const Range& range);
    void PartIsReady(const Range& part);

    GradientSums& all_;
    std::vector<Subtree> subtrees_;
    std::vector<std::int64_t> portions_;
    std::vector<std::size_t> subtree_of_;              // of each of portions_
    std::vector<AlignedVector<float>> levels_, sums_;  // of incomplete subtrees; of subtrees_
    std::vector<std::vector<nn::Gradient>> products_;  // of each of portions_, by parameter
    AlignedVector<float> after_;                       // statistics of a portion
    std::size_t at_ = 0;                               // which of portions_
    bool told_ = false;                                // of the gradients of this portion
  };
  // One for each lane of the context.
  std::span<const std::unique_ptr<Lane>> lanes() const { return lanes_; }

  void BeginUpdate();
  // When all lanes have ended. Waits for the other ranks; then means() are those of all portions,
  // and so are the statistics. False if `meanwhile`, called periodically, returns false first.
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
  void MakeLanes(std::vector<Subtree> subtrees);
  template <class Things>
  void LayOut(const Things& things);
  // The rows of a product that stays one, 0 of any other gradient.
  std::int64_t RowsOf(const nn::Gradient& gradient) const;
  std::int64_t RowsOf(const nn::Var& /*parameter*/) const { return 0; }
  void MakeMeans();
  void StackProducts();
  float* SumOf(std::size_t subtree) const;
  float Scale() const { return 1 / static_cast<float>(shape_.portions); }
  // In parallel, over all numbers that are summed.
  template <class Body>
  void ForNumbers(const Body& body) const;
  void AddLanes(const Range& numbers) const;
  void BeginExchange();
  void TakeTotals(const Range& numbers) const;
  void TakeOwn(const std::function<bool()>& meanwhile);
  void TakeStatistics(const float* totals, float scale);
  void CopyStatistics(float* to) const;
  void SetStatistics(const float* from) const;

  nn::Context& context_;
  const Shape shape_;
  std::vector<nn::NamedTensor> statistics_;
  std::size_t statistics_numbers_ = 0;

  std::vector<std::unique_ptr<Lane>> lanes_;
  struct Place {
    std::size_t lane, subtree;  // of the lane
  };
  std::vector<Place> subtrees_;  // of all lanes, in order
  struct Addition {
    std::size_t left, right;  // of subtrees_: the sum goes to the left one
  };
  std::vector<Addition> additions_;  // that make sums of this process's subtrees
  std::vector<std::size_t> own_;     // of subtrees_: where those sums are then

  std::mutex mutex_;  // of laid_out_, and while it is false of what LayOut sets
  bool laid_out_ = false;
  std::vector<nn::Shape> shapes_;    // of parameters
  std::vector<std::int64_t> rows_;   // RowsOf their gradients
  std::vector<std::size_t> sizes_;   // numbers that are summed here
  std::vector<std::size_t> stacks_;  // parameters with rows
  BucketLayout layout_;
  std::vector<std::size_t> ready_;  // ready parts of each bucket
  bool exchanging_ = false;
  AlignedVector<float> total_, before_, after_;  // of all; statistics
  nn::StepVector<nn::Gradient> means_;
  std::vector<float*> mean_numbers_;  // of means_; null: a product
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
