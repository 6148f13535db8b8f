// SPDX-License-Identifier: Apache-2.0
#include "train/portioned_update.h"

#include <cmath>
#include <limits>

#include "base/error.h"

namespace tilegrad::train {
namespace {

// Of an update that says nothing of the step's loss; one that is not finite would be an error.
constexpr double kNoLoss = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kBeforeTerms = 3;  // numbers: loss, images, stream seconds

Transport* RanksOf(Crew* crew) { return crew ? &crew->ranks() : nullptr; }

}  // namespace

PortionedUpdate::PortionedUpdate(Task& task, Crew* crew, std::int64_t portions,
                                 std::unique_ptr<GradientSums> sums)
    : task_(task),
      crew_(crew),
      portions_(portions),
      sums_(std::move(sums)),
      value_sums_(portions, RanksOf(crew)) {}

Result<std::unique_ptr<PortionedUpdate>> PortionedUpdate::Make(nn::Context& context, Task& task,
                                                               const Schedule& schedule,
                                                               Crew* crew) {
  const std::int64_t portions = schedule.portions;
  if (crew && crew->ranks().size() > portions) {
    return InvalidArgument(
        "{} ranks cannot share {} portion{} of a batch: set schedule.portions to a power of two "
        "that is not smaller, or start fewer ranks",
        crew->ranks().size(), portions, portions == 1 ? "" : "s");
  }
  if (context.dtype() != nn::DType::kF32) return InternalError("portions are summed in F32");
  TILEGRAD_ASSIGN(auto statistics, task.Statistics());
  auto sums = std::make_unique<GradientSums>(
      context, GradientSums::Shape{.portions = portions, .ranks = RanksOf(crew)},
      std::move(statistics));
  return std::unique_ptr<PortionedUpdate>(
      new PortionedUpdate(task, crew, portions, std::move(sums)));
}

Status PortionedUpdate::Run(const UpdateIndex& at, StepValues* values) {
  sums_->BeginUpdate();
  value_sums_.BeginUpdate();
  Status status = Backward(at);
  if (status.ok()) status = Finish(values);
  if (!status.ok()) {
    sums_->GiveUp();
    return status;
  }
  return Update(at, values);
}

Status PortionedUpdate::Update(UpdateIndex at, StepValues* values) {
  WeightShare* const share = sums_->share();
  at.share = share;
  const Status status = task_.Update(at, sums_->means());
  TILEGRAD_TRY(alarm_);
  TILEGRAD_TRY(status);
  if (!share) return {};
  if (!share->finished()) return InternalError("Task::Update gave no share to its optimizer");
  values->wait_seconds += share->seconds_waited();
  return {};
}

Status PortionedUpdate::Backward(UpdateIndex at) {
  at.listener = sums_.get();
  for (std::size_t i = 0; i < sums_->portions().size(); ++i) {
    at.portion = {sums_->portions()[i], portions_};
    portion_.loss = kNoLoss;
    portion_.images = 0;
    portion_.stream_seconds = 0;
    portion_.terms.clear();
    portion_.also.clear();
    sums_->BeginPortion(i);
    TILEGRAD_ASSIGN(const auto gradients, task_.Backward(at, &portion_));
    sums_->EndPortion(gradients);
    AddValues();
  }
  return {};
}

void PortionedUpdate::AddValues() {
  numbers_ = {portion_.loss, static_cast<double>(portion_.images), portion_.stream_seconds};
  for (const LossTerm& term : portion_.terms) numbers_.push_back(term.value);
  value_sums_.Add(numbers_);
}

Status PortionedUpdate::Finish(StepValues* values) {
  const auto all_is_well = [this] {
    if (crew_ && crew_->leads()) alarm_ = crew_->Alarm();
    return alarm_.ok();
  };
  if (!sums_->Finish(all_is_well)) return alarm_;
  const std::span<const double> numbers = value_sums_.Finish(all_is_well);
  TILEGRAD_TRY(alarm_);
  if (crew_) {
    values->wait_seconds += sums_->seconds_waited();
    values->summed_numbers += static_cast<double>(sums_->numbers());
  }
  if (!numbers.empty()) TakeValues(numbers, values);
  return {};
}

void PortionedUpdate::TakeValues(std::span<const double> sums, StepValues* values) const {
  const auto count = static_cast<double>(portions_);
  if (std::isfinite(sums[0])) values->loss = sums[0] / count;
  values->images += static_cast<std::int64_t>(sums[1]);
  values->stream_seconds += sums[2];
  for (std::size_t i = 0; i < portion_.terms.size(); ++i) {
    values->terms.push_back(portion_.terms[i]);
    values->terms.back().value = sums[kBeforeTerms + i] / count;
  }
  values->also.insert(values->also.end(), portion_.also.begin(), portion_.also.end());
}

}  // namespace tilegrad::train
