// SPDX-License-Identifier: Apache-2.0
// Adam, gradient norms, weight averages, learning-rate schedules.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

#include "nn/context.h"
#include "nn/kernels/adam.h"
#include "nn/kernels/product_adam.h"
#include "nn/layers.h"
#include "nn/tape.h"
#include "nn/tensor.h"

namespace tilegrad::nn {

class Adam;

// Distributes an optimiser's step over processes: each updates some of the parameters and receives
// the others.
class UpdateShare {
 public:
  struct Piece {
    std::size_t parameter = 0, begin = 0, end = 0;  // numbers [begin, end) of it
  };
  virtual ~UpdateShare() = default;
  virtual void Begin(const Adam& adam) = 0;
  virtual std::size_t pieces() const = 0;  // to update in this process
  virtual Piece piece(std::size_t k) const = 0;
  virtual void Updated(std::size_t k) = 0;  // its numbers are final; called from several threads
  virtual Status Finish() = 0;              // returns when all numbers have arrived
};

// A symmetric linear map of a parameter's numbers, such as smoothing over neighbours.
class StepMap {
 public:
  virtual ~StepMap() = default;
  virtual void Apply(std::span<float> x) = 0;
};

struct AdamOptions {
  double learning_rate = 1e-3;
  double beta1 = 0.9;
  double beta2 = 0.999;
  double epsilon = 1e-8;  // added to sqrt(v / (1 - beta2^t)), as in PyTorch
  // AdamW (Loshchilov, Hutter 2019): each step also subtracts learning_rate * weight_decay times
  // the parameter. Biases and norm parameters, which have rank 1, do not decay.
  double weight_decay = 0;
  // For f32 parameters: applied to gradients and steps; all numbers of a parameter share its
  // largest second moment, so that a step keeps the direction of the gradient's average. No epsilon
  // and no decay. (B. Nicolet, A. Jacobson, W. Jakob, Large Steps in Inverse Rendering of Geometry,
  // 2021.) Not with an UpdateShare. Must outlive the optimiser.
  StepMap* map = nullptr;
};

// Adam (Kingma, Ba 2015): one pass over parameter, gradient and both moments; if the gradient is a
// product with few steps, as with batches of up to 256, without storing the gradient.
class Adam {
 public:
  Adam(Context& context, std::vector<NamedVar> parameters, const AdamOptions& options);
  Adam(const Adam&) = delete;
  Adam& operator=(const Adam&) = delete;

  // One step along `gradients`, as returned by Gradients or Grad for parameters(), with the same
  // bits. Refuses an invalid or mismatched gradient before changing anything.
  Status Step(std::span<const Gradient> gradients);
  Status Step(std::span<const Var> gradients);

  // The same if `share` is null. Otherwise reads gradients and updates moments only for its pieces;
  // these gradients must be values, not products.
  Status Step(std::span<const Gradient> gradients, UpdateShare* share);

  AdamOptions& options() { return options_; }  // schedules set learning_rate here
  std::span<const Var> parameters() const { return parameters_; }  // in the order given
  std::span<const Tensor> moments(std::size_t i) const { return slots_[i].moments; }  // m, v
  std::int64_t steps() const { return steps_; }
  // For callers that restore moments themselves. >= 0.
  void set_steps(std::int64_t steps) { steps_ = steps; }

  // "adam.m.<parameter>" and "adam.v.<parameter>" for each, and "adam.steps" ([1] of kI64). Loading
  // restores the same bits; errors as CopyByName, and DataLoss if steps < 0.
  std::vector<NamedTensor> State() const;
  Status LoadState(const std::vector<NamedTensor>& state);

 private:
  struct Slot {
    NamedVar parameter;
    std::array<Tensor, 2> moments;  // m and v, of the parameter's shape, 0 at the start
  };
  struct Numbers {
    std::size_t begin, end;
  };
  struct Piece {
    std::size_t slot;
    Numbers numbers;
  };
  Status Check(std::span<const Gradient> gradients) const;
  // Quantities shared by all parameters of step steps() (1, 2, ..), then the update of each.
  void BeginStep();
  // Numbers [begin, end); called from several threads with disjoint ranges.
  void Update(Slot& slot, const Tensor& gradient, Numbers numbers);
  void UpdatePieces(std::span<const Gradient> gradients);
  // Adds to products_, or updates at once if the kernel does not support it.
  void AddProduct(Slot& slot, const Gradient& product);
  void UpdateProducts();
  void UpdateThroughMap(Slot& slot, const Tensor& gradient);
  template <class T>
  AdamProblem<T> Problem(Slot& slot, Numbers numbers) const;

  Context& context_;
  AdamOptions options_;
  AdamCoefficients coefficients_;
  std::vector<Slot> slots_;
  std::vector<Var> parameters_;               // of the slots
  std::vector<Piece> pieces_;                 // of all parameters, updated by a step in one loop
  std::vector<ProductAdamProblem> products_;  // with gradients computed on the fly
  std::int64_t steps_ = 0;
};

// Square root of the sum of all squares, summed in double and in a fixed order. Not finite if a
// gradient is not, so check it before a step.
double GlobalNorm(Context& context, std::span<const Var> gradients);
double GlobalNorm(Context& context, std::span<const Gradient> gradients);  // computes products
// Whether GlobalNorm is finite. Computes a product only if its factors are too large for the
// Cauchy-Schwarz inequality to decide.
bool IsFinite(Context& context, std::span<const Gradient> gradients);

// Exponential moving average of weights, for evaluation: smoother than the weights in
// training.
//
//   MovingAverage average(context, State(net), 0.999);
//   ... each step:      average.Update();
//   ... to evaluate:    LoadState(other_net, average.values());

class MovingAverage {
 public:
  // Tracks `tensors` (of kF32 or kF64), sharing their storage; starts as a copy of them.
  MovingAverage(Context& context, std::vector<NamedTensor> tensors, double decay);
  void Update();  // average = decay average + (1 - decay) tensor

  const std::vector<NamedTensor>& values() const { return averages_; }  // by tensor name
  // "ema.<name>". Loading restores the same bits; errors as CopyByName.
  std::vector<NamedTensor> State() const;
  Status LoadState(const std::vector<NamedTensor>& state) { return CopyByName(state, State()); }

 private:
  Context& context_;
  double decay_;
  std::vector<NamedTensor> tensors_, averages_;
  struct Piece {
    std::size_t tensor, begin, end;
  };
  std::vector<Piece> pieces_;  // of all tensors: an update is one loop
};

// Extracts the averages from `state`, which may hold other tensors, under the names of their
// tensors.
std::vector<NamedTensor> Averages(const std::vector<NamedTensor>& state);

// Learning-rate schedules: pure functions of the step (0, 1, ..), so a resumed run needs no state.
//
//   adam.options().learning_rate = WarmedUp(CosineRate(1e-3, {.steps = 10000}, step), 100, step);

// From 1 at t = 0 along half a cosine to `end` at t = 1, then constant.
inline double HalfCosine(double end, double t) {
  return end + (1 - end) * (0.5 * (1 + std::cos(std::numbers::pi * std::min(t, 1.0))));
}
// From `from` > 0 at t = 0 by equal factors to `to` > 0 at t = 1, then constant.
inline double Geometric(double from, double to, double t) {
  return from * std::pow(to / from, std::min(t, 1.0));
}

// From the rate at step 0 along half a cosine to final_factor times the rate at `steps`, then
// constant (Loshchilov, Hutter 2017). steps >= 1.
struct CosineSchedule {
  std::int64_t steps = 1;
  double final_factor = 0;
};
inline double CosineRate(double rate, const CosineSchedule& schedule, std::int64_t step) {
  const double progress = static_cast<double>(step) / static_cast<double>(schedule.steps);
  return rate * HalfCosine(schedule.final_factor, progress);
}

// Linear warm-up: 1/steps of `rate` at step 0, all of it from step steps - 1 on.
inline double WarmedUp(double rate, std::int64_t steps, std::int64_t step) {
  return step < steps ? rate * static_cast<double>(step + 1) / static_cast<double>(steps) : rate;
}

}  // namespace tilegrad::nn
