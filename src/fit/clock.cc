// SPDX-License-Identifier: Apache-2.0
#include "fit/clock.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "base/text.h"

namespace tilegrad::train {
namespace {

constexpr const char *kCounts = "clock.counts", *kSums = "clock.sums";

template <class T, std::size_t N>
nn::NamedTensor Tensor(nn::Context& context, const char* name, nn::DType type,
                       const std::array<T, N>& values) {
  nn::Tensor tensor = context.Empty({static_cast<std::int64_t>(N)}, type);
  std::copy(values.begin(), values.end(), tensor.data<T>());
  return {name, tensor};
}

const nn::Tensor* Find(std::span<const nn::NamedTensor> state, const char* name) {
  const auto at = std::find_if(state.begin(), state.end(),
                               [&](const nn::NamedTensor& t) { return t.name == name; });
  return at == state.end() ? nullptr : &at->value;
}

}  // namespace

FitClock::FitClock(const FitConfig& config)
    : steps_(config.steps),
      gain_(config.stop_gain),
      earliest_(EarliestStopTime(config)),
      end_(config.steps) {}

double FitClock::At(std::int64_t step) const {
  const std::int64_t fast = stop_started_ < 0 ? 0 : std::max<std::int64_t>(0, step - stop_started_);
  const std::int64_t time = step + fast * (kSpeedup - 1);
  return std::min(1.0, static_cast<double>(time) / static_cast<double>(steps_));
}

bool FitClock::MayStopEarly(std::int64_t step) const {
  return gain_ > 0 && stop_started_ < 0 && At(step) >= earliest_;
}

void FitClock::StopEarly(std::int64_t step) {
  stop_started_ = step;
  end_ = step + (steps_ - step + kSpeedup - 1) / kSpeedup;
}

void FitClock::Note(std::int64_t step, double loss) {
  if (!MayStopEarly(step)) return;
  sum_ += loss;
  if (++counted_ < kWindow) return;
  if (before_ >= 0 && sum_ > (1 - gain_) * before_) StopEarly(step + 1);
  before_ = std::exchange(sum_, 0);
  counted_ = 0;
}

std::vector<nn::NamedTensor> FitClock::State(nn::Context& context) const {
  const std::array counts = {steps_, stop_started_, extended_at_, counted_};
  return {Tensor(context, kCounts, nn::DType::kI64, counts),
          Tensor(context, kSums, nn::DType::kF64, std::array{sum_, before_})};
}

Status FitClock::LoadState(std::span<const nn::NamedTensor> state, std::int64_t steps) {
  const nn::Tensor *counts = Find(state, kCounts), *sums = Find(state, kSums);
  if (counts == nullptr) return {};
  if (counts->dtype() != nn::DType::kI64 || counts->elements() != 4 || sums == nullptr ||
      sums->dtype() != nn::DType::kF64 || sums->elements() != 2) {
    return DataLoss("\"{}\" and \"{}\" were not written by this version", kCounts, kSums);
  }
  const std::int64_t* c = counts->data<std::int64_t>();
  const double* s = sums->data<double>();
  if (c[1] > steps || c[2] < 0 || c[2] > steps || c[3] < 0 || c[3] >= kWindow ||
      !std::isfinite(s[0]) || !std::isfinite(s[1])) {
    return DataLoss("the values of \"{}\" and \"{}\" are impossible", kCounts, kSums);
  }
  extended_at_ = c[2];
  if (c[0] > steps_) {
    return InvalidArgument("the fit was started with {}; give as many or more",
                           Count(c[0], "step"));
  }
  if (c[0] < steps_) {
    extended_at_ = steps;
    return {};
  }
  if (c[1] >= 0) StopEarly(c[1]);
  counted_ = c[3];
  sum_ = s[0];
  before_ = s[1];
  return {};
}

}  // namespace tilegrad::train
