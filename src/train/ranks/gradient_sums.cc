// SPDX-License-Identifier: Apache-2.0
#include "train/ranks/gradient_sums.h"

#include <algorithm>
#include <chrono>

#include "base/clocks.h"

namespace tilegrad::train {
namespace {

constexpr std::size_t kGrain = 32768;  // numbers to a task

void Resize(std::vector<AlignedVector<float>>* all, std::size_t numbers) {
  for (auto& one : *all) one.resize(std::max(one.size(), numbers));
}

}  // namespace

GradientSums::GradientSums(nn::Context& context, const Shape& shape,
                           std::vector<nn::NamedTensor> statistics)
    : context_(context), shape_(shape), statistics_(std::move(statistics)) {
  for (const nn::NamedTensor& t : statistics_) statistics_numbers_ += t.value.elements();
  before_.resize(statistics_numbers_);
  after_.resize(statistics_numbers_);
  const int ranks = shape.ranks ? shape.ranks->size() : 1;
  const int rank = shape.ranks ? shape.ranks->rank() : 0;
  const std::vector<Subtree> all = SubtreesOf(ranks, shape.portions);
  std::size_t levels = 0;
  for (const Subtree& s : all) {
    if (s.owner != rank) continue;
    levels = std::max(levels, ClimbOf(s.count - 1));
    for (std::int64_t p = s.first; p < s.first + s.count; ++p) {
      portions_.push_back(p);
      subtree_of_.push_back(own_.size());
    }
    own_.push_back(s);
  }
  levels_.resize(levels);
  sums_.resize(own_.size());
  if (ranks <= 1) return;
  exchange_ = std::make_unique<Exchange>(*shape.ranks, all);
  share_ = std::make_unique<WeightShare>(*shape.ranks, context.workers(), *exchange_);
}

void GradientSums::CopyStatistics(float* to) {
  for (const nn::NamedTensor& t : statistics_)
    to = std::copy_n(t.value.data<float>(), t.value.elements(), to);
}

void GradientSums::SetStatistics(const float* from) {
  for (nn::NamedTensor& t : statistics_) {
    std::copy_n(from, t.value.elements(), t.value.data<float>());
    from += t.value.elements();
  }
}

void GradientSums::BeginUpdate() {
  CopyStatistics(before_.data());
  laid_out_ = false;
}

void GradientSums::GiveUp() { SetStatistics(before_.data()); }

void GradientSums::BeginPortion(std::size_t i) {
  at_ = i;
  told_ = false;
  if (i > 0) SetStatistics(before_.data());
}

// Once an update, when it is known which parameters it moves.
template <class Things>
void GradientSums::LayOut(const Things& things) {
  if (laid_out_) return;
  means_ = nn::StepVector<nn::Gradient>(context_.allocator<nn::Gradient>());
  sizes_.clear();
  for (const auto& thing : things) {
    means_.emplace_back(nn::Constant(context_, context_.Empty(thing.shape())));
    sizes_.push_back(static_cast<std::size_t>(thing.shape().elements()));
  }
  layout_.Reset(sizes_, statistics_numbers_, shape_.bucket);
  ready_.assign(layout_.buckets(), 0);
  Resize(&levels_, layout_.total());
  Resize(&sums_, layout_.total());
  laid_out_ = true;
  if (!exchange_) return;
  total_.resize(std::max(total_.size(), layout_.total()));
  Exchange::Job job{&layout_, {}, total_.data(), 1 / static_cast<float>(shape_.portions)};
  for (auto& sum : sums_) job.own.push_back(sum.data());
  exchange_->Begin(job);
}

void GradientSums::Begin(std::span<const nn::Var> parameters) {
  told_ = true;
  LayOut(parameters);
}

void GradientSums::Ready(std::size_t i, const nn::Gradient& gradient) {
  const nn::Var value = gradient.Value();
  if (!value.valid()) return;  // the context knows why
  Add(value.value().data<float>(), layout_.parameter(i));
  PartIsReady(layout_.parameter(i));
}

// The portion's numbers, and those of its left neighbours in the tree, to the place of their sum.
void GradientSums::Add(const float* from, const Range& range) {
  const Subtree& subtree = own_[subtree_of_[at_]];
  const std::int64_t leaf = portions_[at_] - subtree.first;
  const std::size_t climb = ClimbOf(leaf);
  AlignedVector<float>& place =
      leaf + 1 == subtree.count ? sums_[subtree_of_[at_]] : levels_[climb];
  float* to = place.data() + range.begin;
  context_.workers().ForRanges(range.size(), kGrain,
                               [&](std::size_t begin, std::size_t end, std::size_t) {
                                 std::copy(from + begin, from + end, to + begin);
                                 for (std::size_t level = 0; level < climb; ++level) {
                                   const float* left = levels_[level].data() + range.begin;
                                   for (std::size_t i = begin; i < end; ++i)
                                     to[i] = left[i] + to[i];
                                 }
                               });
}

void GradientSums::PartIsReady(const Range& part) {
  if (!IsLastPortion() || !exchange_) return;
  const Range held = layout_.BucketsOf(part);
  for (std::size_t b = held.begin; b < held.end; ++b) {
    if (++ready_[b] == layout_.parts(b)) exchange_->Start(b);
  }
}

void GradientSums::EndPortion(std::span<const nn::Gradient> gradients) {
  if (!told_) {
    LayOut(gradients);
    for (std::size_t i = gradients.size(); i-- > 0;) Ready(i, gradients[i]);
  }
  CopyStatistics(after_.data());
  Add(after_.data(), layout_.tail());
  PartIsReady(layout_.tail());
}

bool GradientSums::Finish(const std::function<bool()>& meanwhile) {
  const auto start = std::chrono::steady_clock::now();
  if (exchange_ && !exchange_->Wait(meanwhile)) return false;
  seconds_waited_ = SecondsSince(start);
  if (share_) {
    TakeOwn(meanwhile);
  } else {
    TakeTotals();
  }
  return true;
}

void GradientSums::TakeOwn(const std::function<bool()>& meanwhile) {
  share_->Prepare(
      {&layout_, total_.data(), meanwhile, [this] { TakeStatistics(total_.data(), 1); }});
  share_->ForOwn([&](const nn::UpdateShare::Piece& piece, std::size_t flat) {
    nn::Tensor mean = means_[piece.parameter].Value().value();
    std::copy_n(total_.data() + flat, piece.end - piece.begin, mean.data<float>() + piece.begin);
  });
}

void GradientSums::TakeTotals() {
  const float scale = 1 / static_cast<float>(shape_.portions);
  const float* totals = sums_[0].data();
  for (std::size_t i = 0; i < means_.size(); ++i) {
    const Range range = layout_.parameter(i);
    nn::Tensor mean = means_[i].Value().value();
    float* to = mean.data<float>();
    context_.workers().ForRanges(range.size(), kGrain,
                                 [&](std::size_t begin, std::size_t end, std::size_t) {
                                   for (std::size_t k = begin; k < end; ++k)
                                     to[k] = totals[range.begin + k] * scale;
                                 });
  }
  TakeStatistics(totals, scale);
}

void GradientSums::TakeStatistics(const float* totals, float scale) {
  const float* tail = totals + layout_.tail().begin;
  std::transform(tail, tail + statistics_numbers_, after_.data(),
                 [&](float x) { return x * scale; });
  SetStatistics(after_.data());
}

ValueSums::ValueSums(std::int64_t portions, Transport* ranks)
    : ranks_(ranks), subtrees_(SubtreesOf(ranks ? ranks->size() : 1, portions)) {
  std::size_t levels = 0;
  for (std::size_t i = 0; i < subtrees_.size(); ++i) {
    if (subtrees_[i].owner != (ranks ? ranks->rank() : 0)) continue;
    own_.push_back(i);
    levels = std::max(levels, ClimbOf(subtrees_[i].count - 1));
  }
  rows_.resize(subtrees_.size());
  levels_.resize(levels);
}

void ValueSums::Add(std::span<const double> numbers) {
  const std::size_t at = own_[subtree_], climb = ClimbOf(leaf_);
  const bool last = leaf_ + 1 == subtrees_[at].count;
  std::vector<double>& to = last ? rows_[at] : levels_[climb];
  to.assign(numbers.begin(), numbers.end());
  for (std::size_t level = 0; level < climb; ++level) {
    for (std::size_t i = 0; i < to.size(); ++i) to[i] = levels_[level][i] + to[i];
  }
  leaf_ = last ? 0 : leaf_ + 1;
  subtree_ += last ? 1 : 0;
}

std::span<const double> ValueSums::Finish(const std::function<bool()>& meanwhile) {
  const std::size_t numbers = rows_[own_[0]].size();
  for (std::size_t i = 0; i < subtrees_.size(); ++i) {
    const int owner = subtrees_[i].owner;
    const int me = ranks_ ? ranks_->rank() : 0;
    if (me > 0 && owner == me)
      SendAndWait(*ranks_, {0, MessageKind::kValues}, std::as_bytes(std::span(rows_[i])));
    if (me > 0 || owner == 0) continue;
    rows_[i].resize(numbers);
    const auto ticket =
        ranks_->Receive({owner, MessageKind::kValues}, std::as_writable_bytes(std::span(rows_[i])));
    if (!Await(*ranks_, ticket, meanwhile)) return {};
  }
  if (ranks_ && ranks_->rank() > 0) return {};
  FoldSubtrees(subtrees_, &scratch_, [&](std::size_t left, std::size_t right) {
    for (std::size_t k = 0; k < numbers; ++k) rows_[left][k] += rows_[right][k];
  });
  return rows_[0];
}

}  // namespace tilegrad::train
