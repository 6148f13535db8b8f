// SPDX-License-Identifier: Apache-2.0
#include "train/ranks/gradient_sums.h"

#include <algorithm>
#include <chrono>

#include "base/clocks.h"
#include "base/error.h"
#include "nn/kernels/product_adam.h"

namespace tilegrad::train {
namespace {

constexpr std::size_t kGrain = 32768;      // numbers to a task
constexpr std::size_t kAddedGrain = 4096;  // of each lane: all of them stay in a cache

void Resize(std::vector<AlignedVector<float>>* all, std::size_t numbers) {
  for (auto& one : *all) one.resize(std::max(one.size(), numbers));
}

int RankOf(const GradientSums::Shape& shape) { return shape.ranks ? shape.ranks->rank() : 0; }
int RanksOf(const GradientSums::Shape& shape) { return shape.ranks ? shape.ranks->size() : 1; }

const nn::Shape& ShapeOf(const nn::Var& parameter) { return parameter.shape(); }
nn::Shape ShapeOf(const nn::Gradient& gradient) { return gradient.shape(); }

// Rows to where portion `portion` has its own.
void CopyRows(const nn::Var& from, std::int64_t portion, nn::Tensor to) {
  const nn::Tensor& rows = from.value();
  std::copy_n(rows.data<float>(), rows.elements(),
              to.data<float>() + static_cast<std::size_t>(portion) * rows.elements());
}

}  // namespace

GradientSums::GradientSums(nn::Context& context, const Shape& shape,
                           std::vector<nn::NamedTensor> statistics)
    : context_(context), shape_(shape), statistics_(std::move(statistics)) {
  for (const nn::NamedTensor& t : statistics_) statistics_numbers_ += t.value.elements();
  before_.resize(statistics_numbers_);
  after_.resize(statistics_numbers_);
  context.CopyForLanes(statistics_);
  const auto lanes = static_cast<int>(context.lanes());
  MakeLanes(SubtreesOf(RanksOf(shape) * lanes, shape.portions));
  if (RanksOf(shape) == 1) return;
  exchange_ = std::make_unique<Exchange>(*shape.ranks, SubtreesOf(RanksOf(shape), shape.portions));
  share_ = std::make_unique<WeightShare>(*shape.ranks, context.workers(), *exchange_);
}

GradientSums::~GradientSums() = default;

std::size_t GradientSums::MostLanes(const Shape& shape) {
  return static_cast<std::size_t>(std::max<std::int64_t>(1, shape.portions / RanksOf(shape)));
}

// `subtrees`: as if each lane of each rank were a rank. Those of one rank lie within the rank's
// own subtrees, which are the largest that its portions fill.
void GradientSums::MakeLanes(std::vector<Subtree> subtrees) {
  const auto lanes = static_cast<int>(context_.lanes());
  std::erase_if(subtrees, [&](const Subtree& s) { return s.owner / lanes != RankOf(shape_); });
  std::vector<std::vector<Subtree>> of_lane(context_.lanes());
  for (const Subtree& s : subtrees) {
    const auto lane = static_cast<std::size_t>(s.owner % lanes);
    subtrees_.push_back({lane, of_lane[lane].size()});
    of_lane[lane].push_back(s);
  }
  for (auto& own : of_lane) lanes_.push_back(std::make_unique<Lane>(*this, std::move(own)));
  std::vector<Subtree> open;
  FoldSubtrees(subtrees, &open, [this](std::size_t left, std::size_t right) {
    additions_.push_back({left, right});
  });
  for (const Subtree& s : open) own_.push_back(static_cast<std::size_t>(s.owner));
}

void GradientSums::CopyStatistics(float* to) const {
  for (const nn::NamedTensor& t : statistics_) {
    const nn::Tensor here = context_.InLane(t.value);
    to = std::copy_n(here.data<float>(), here.elements(), to);
  }
}

void GradientSums::SetStatistics(const float* from) const {
  for (const nn::NamedTensor& t : statistics_) {
    nn::Tensor here = context_.InLane(t.value);
    std::copy_n(from, here.elements(), here.data<float>());
    from += here.elements();
  }
}

void GradientSums::BeginUpdate() {
  CopyStatistics(before_.data());
  laid_out_ = false;
  exchanging_ = false;
}

void GradientSums::GiveUp() { SetStatistics(before_.data()); }

// Once an update, by the lane that first knows which parameters it moves.
template <class Things>
void GradientSums::LayOut(const Things& things) {
  const std::scoped_lock lock(mutex_);
  if (laid_out_) return;
  sizes_.clear();
  shapes_.clear();
  rows_.clear();
  stacks_.clear();
  for (const auto& thing : things) {
    shapes_.push_back(ShapeOf(thing));
    rows_.push_back(RowsOf(thing));
    const bool summed = rows_.back() == 0;
    if (!summed) stacks_.push_back(shapes_.size() - 1);
    sizes_.push_back(summed ? static_cast<std::size_t>(shapes_.back().elements()) : 0);
  }
  layout_.Reset(sizes_, statistics_numbers_, shape_.bucket);
  ready_.assign(layout_.buckets(), 0);
  laid_out_ = true;
}

std::int64_t GradientSums::RowsOf(const nn::Gradient& gradient) const {
  if (exchange_ || !gradient.is_product() || gradient.portions() != 1) return 0;
  const std::int64_t rows = gradient.a().shape()[0];
  const bool few = shape_.portions * rows <= static_cast<std::int64_t>(nn::kMostProductAdamSteps);
  return few && gradient.shape().elements() > 0 ? rows : 0;
}

float* GradientSums::SumOf(std::size_t subtree) const {
  const Place& place = subtrees_[subtree];
  return lanes_[place.lane]->sums_[place.subtree].data();
}

void GradientSums::BeginExchange() {
  if (exchanging_) return;
  exchanging_ = true;
  total_.resize(std::max(total_.size(), layout_.total()));
  Exchange::Job job{&layout_, {}, total_.data(), 1 / static_cast<float>(shape_.portions)};
  for (const std::size_t subtree : own_) job.own.push_back(SumOf(subtree));
  exchange_->Begin(job);
}

GradientSums::Lane::Lane(GradientSums& all, std::vector<Subtree> subtrees)
    : all_(all), subtrees_(std::move(subtrees)), sums_(subtrees_.size()) {
  std::size_t levels = 0;
  for (std::size_t i = 0; i < subtrees_.size(); ++i) {
    const Subtree& s = subtrees_[i];
    levels = std::max(levels, ClimbOf(s.count - 1));
    for (std::int64_t p = s.first; p < s.first + s.count; ++p) {
      portions_.push_back(p);
      subtree_of_.push_back(i);
    }
  }
  levels_.resize(levels);
  products_.resize(portions_.size());
  after_.resize(all.statistics_numbers_);
}

void GradientSums::Lane::BeginPortion(std::size_t i) {
  at_ = i;
  told_ = false;
  all_.SetStatistics(all_.before_.data());
}

template <class Things>
void GradientSums::Lane::LayOut(const Things& things) {
  all_.LayOut(things);
  Resize(&levels_, all_.layout_.total());
  Resize(&sums_, all_.layout_.total());
}

void GradientSums::Lane::Begin(std::span<const nn::Var> parameters) {
  told_ = true;
  LayOut(parameters);
}

void GradientSums::Lane::Ready(std::size_t i, const nn::Gradient& gradient) {
  const nn::Var value = gradient.Value();
  if (!value.valid()) return;  // the context knows why
  Add(value.value().data<float>(), all_.layout_.parameter(i));
  PartIsReady(all_.layout_.parameter(i));
}

// The portion's numbers, and those of its left neighbours in the tree, to the place of their sum.
void GradientSums::Lane::Add(const float* from, const Range& range) {
  const Subtree& subtree = subtrees_[subtree_of_[at_]];
  const std::int64_t leaf = portions_[at_] - subtree.first;
  const std::size_t climb = ClimbOf(leaf);
  AlignedVector<float>& place =
      leaf + 1 == subtree.count ? sums_[subtree_of_[at_]] : levels_[climb];
  float* to = place.data() + range.begin;
  const auto add = [&](std::size_t begin, std::size_t end, std::size_t) {
    std::copy(from + begin, from + end, to + begin);
    for (std::size_t level = 0; level < climb; ++level) {
      const float* left = levels_[level].data() + range.begin;
      for (std::size_t i = begin; i < end; ++i) to[i] = left[i] + to[i];
    }
  };
  const Workers& workers = all_.context_.workers();
  workers.NoteTraffic(static_cast<double>((2 + climb) * range.size() * sizeof(float)));
  workers.ForRanges(range.size(), kGrain, add);
}

// Sums of several lanes are not final before they are added.
void GradientSums::Lane::PartIsReady(const Range& part) {
  if (!all_.exchange_ || all_.lanes_.size() > 1 || at_ + 1 < portions_.size()) return;
  all_.BeginExchange();
  const Range held = all_.layout_.BucketsOf(part);
  for (std::size_t b = held.begin; b < held.end; ++b) {
    if (++all_.ready_[b] == all_.layout_.parts(b)) all_.exchange_->Start(b);
  }
}

// All portions of an update have graphs of one form.
void GradientSums::Lane::Take(std::size_t i, const nn::Gradient& gradient) {
  const std::int64_t rows = all_.rows_[i];
  if (all_.RowsOf(gradient) != rows)
    return all_.context_.Fail(
        InternalError("gradient {} is a product of {} rows in one portion and of {} in another", i,
                      rows, all_.RowsOf(gradient)));
  if (rows == 0) return Ready(i, gradient);
  products_[at_][i] = gradient;
}

void GradientSums::Lane::EndPortion(std::span<const nn::Gradient> gradients) {
  if (!told_) {
    LayOut(gradients);
    products_[at_].resize(gradients.size());
    for (std::size_t i = gradients.size(); i-- > 0;) Take(i, gradients[i]);
  }
  all_.CopyStatistics(after_.data());
  Add(after_.data(), all_.layout_.tail());
  PartIsReady(all_.layout_.tail());
}

template <class Body>
void GradientSums::ForNumbers(const Body& body) const {
  const std::size_t bytes = layout_.total() * sizeof(float);
  context_.workers().NoteTraffic(static_cast<double>((additions_.size() + own_.size()) * bytes));
  context_.workers().ForRanges(layout_.total(), kAddedGrain,
                               [&](std::size_t begin, std::size_t end, std::size_t) {
                                 body(Range{begin, end});
                               });
}

void GradientSums::AddLanes(const Range& numbers) const {
  for (const Addition& addition : additions_) {
    float* const to = SumOf(addition.left);
    const float* const from = SumOf(addition.right);
    for (std::size_t i = numbers.begin; i < numbers.end; ++i) to[i] += from[i];
  }
}

bool GradientSums::Finish(const std::function<bool()>& meanwhile) {
  MakeMeans();
  if (!exchange_) {
    ForNumbers([&](const Range& numbers) {
      AddLanes(numbers);
      TakeTotals(numbers);
    });
    TakeStatistics(SumOf(own_[0]), Scale());
    return true;
  }
  if (lanes_.size() > 1) {
    ForNumbers([&](const Range& numbers) { AddLanes(numbers); });
    BeginExchange();
    for (std::size_t b = 0; b < layout_.buckets(); ++b) exchange_->Start(b);
  }
  const auto start = std::chrono::steady_clock::now();
  if (!exchange_->Wait(meanwhile)) return false;
  seconds_waited_ = SecondsSince(start);
  TakeOwn(meanwhile);
  return true;
}

void GradientSums::MakeMeans() {
  means_ = nn::StepVector<nn::Gradient>(context_.allocator<nn::Gradient>());
  for (std::size_t i = 0; i < shapes_.size(); ++i) {
    const std::int64_t rows = shape_.portions * rows_[i];
    const auto empty = [this](const nn::Shape& shape) {
      return nn::Constant(context_, context_.Empty(shape));
    };
    if (rows == 0) {
      means_.emplace_back(empty(shapes_[i]));
    } else {
      means_.emplace_back(empty({rows, shapes_[i][0]}), empty({rows, shapes_[i][1]}),
                          shape_.portions);
    }
  }
  mean_numbers_.resize(means_.size());
  for (std::size_t i = 0; i < means_.size(); ++i)
    mean_numbers_[i] = rows_[i] == 0 ? means_[i].Value().value().data<float>() : nullptr;
  StackProducts();
}

void GradientSums::StackProducts() {
  for (const auto& lane : lanes_) {
    const std::size_t own = lane->portions_.size();
    context_.workers().For(own * stacks_.size(), [&](std::size_t task, std::size_t) {
      const std::size_t i = stacks_[task / own];
      nn::Gradient& product = lane->products_[task % own][i];
      const std::int64_t portion = lane->portions_[task % own];
      CopyRows(product.a(), portion, means_[i].a().value());
      CopyRows(product.b(), portion, means_[i].b().value());
    });
    for (auto& products : lane->products_) products.clear();
  }
}

void GradientSums::TakeOwn(const std::function<bool()>& meanwhile) {
  share_->Prepare(
      {&layout_, total_.data(), meanwhile, [this] { TakeStatistics(total_.data(), 1); }});
  share_->ForOwn([&](const nn::UpdateShare::Piece& piece, std::size_t flat) {
    nn::Tensor mean = means_[piece.parameter].Value().value();
    std::copy_n(total_.data() + flat, piece.end - piece.begin, mean.data<float>() + piece.begin);
  });
}

void GradientSums::TakeTotals(const Range& numbers) const {
  const float* const totals = SumOf(own_[0]);
  const float scale = Scale();
  for (std::size_t i = 0; i < mean_numbers_.size(); ++i) {
    const Range range = layout_.parameter(i);
    const std::size_t end = std::min(range.end, numbers.end);
    for (std::size_t k = std::max(range.begin, numbers.begin); k < end; ++k)
      mean_numbers_[i][k - range.begin] = totals[k] * scale;
  }
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
