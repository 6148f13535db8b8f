// SPDX-License-Identifier: Apache-2.0
// Optimisers, and the norm of a gradient. Learning-rate schedules: schedule.h.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "nn/kernels/adam.h"
#include "nn/layers.h"
#include "nn/tape.h"

namespace tilegrad::nn {

class Optimizer;

// Who takes part in a step that several processes share out: each moves some of the numbers and
// gets the others from elsewhere.
class UpdateShare {
 public:
  struct Piece {
    std::size_t parameter = 0, begin = 0, end = 0;  // numbers [begin, end) of it
  };
  virtual ~UpdateShare() = default;
  virtual void Begin(const Optimizer& optimizer) = 0;
  virtual std::size_t pieces() const = 0;  // that are to be moved here
  virtual Piece piece(std::size_t k) const = 0;
  virtual void Updated(std::size_t k) = 0;  // its numbers are final; called by several threads
  virtual Status Finish() = 0;              // returns when all numbers are there
};

class Optimizer {
 public:
  virtual ~Optimizer() = default;
  Optimizer(const Optimizer&) = delete;
  Optimizer& operator=(const Optimizer&) = delete;

  // One step along `gradients` (as Gradients or Grad return them for parameters(): same bits), each
  // multiplied by `gradient_scale` on the way (see ClipFactor). A gradient that is not valid or
  // does not fit is refused before anything is changed.
  Status Step(std::span<const Gradient> gradients, double gradient_scale = 1.0);
  Status Step(std::span<const Var> gradients, double gradient_scale = 1.0);

  // The same where `share` is not null, of whose pieces alone gradients are read: values, no
  // products. Moments of other numbers stay behind.
  Status Step(std::span<const Gradient> gradients, UpdateShare* share);

  std::span<const Var> parameters() const { return parameters_; }  // in the order given
  std::span<const Tensor> moments(std::size_t i) const { return slots_[i].moments; }
  std::int64_t steps() const { return steps_; }

  // "<name>.<moment>.<parameter>" for each moment, and "<name>.steps" ([1] of kI64); name: "adam"
  // or "sgd". Loading restores the same bits; errors as CopyByName, and DataLoss if steps < 0.
  std::vector<NamedTensor> State() const;
  Status LoadState(const std::vector<NamedTensor>& state);

 protected:
  struct Slot {
    NamedVar parameter;
    std::vector<Tensor> moments;  // of the parameter's shape, 0 at the start
  };
  Optimizer(Context& context, std::string name, std::vector<std::string> moments,
            std::vector<NamedVar> parameters);
  // What all parameters of step steps() (1, 2, ..) share, then each of them.
  virtual void BeginStep(double gradient_scale) = 0;
  // Numbers [begin, end); called by several threads, each with other numbers.
  struct Numbers {
    std::size_t begin, end;
  };
  virtual void Update(Slot& slot, const Tensor& gradient, Numbers numbers) = 0;
  // Where the gradient is a product; as it stands it computes that first.
  virtual void UpdateByProduct(Slot& slot, const Gradient& product) {
    Update(slot, product.Value().value(), {0, slot.parameter.value.value().elements()});
  }
  Context& context() const { return context_; }
  const Workers& workers() const { return context_.workers(); }

 private:
  Context& context_;
  std::string name_;
  std::vector<std::string> moments_;
  Status Check(std::span<const Gradient> gradients) const;
  std::vector<Slot> slots_;
  std::vector<Var> parameters_;  // of the slots
  std::int64_t steps_ = 0;
};

struct AdamOptions {
  double learning_rate = 1e-3;
  double beta1 = 0.9;
  double beta2 = 0.999;
  double epsilon = 1e-8;  // added to sqrt(v / (1 - beta2^t)), as PyTorch does
  // AdamW (Loshchilov, Hutter 2019): each step also takes learning_rate * weight_decay of a
  // parameter away. Biases and norm parameters, which have rank 1, do not decay.
  double weight_decay = 0;
};

// Adam (Kingma, Ba 2015): one pass over parameter, gradient and both moments "m" and "v"; where the
// gradient is a product of few steps, as with batches of up to 256, without the gradient.
class Adam : public Optimizer {
 public:
  Adam(Context& context, std::vector<NamedVar> parameters, const AdamOptions& options)
      : Optimizer(context, "adam", {"m", "v"}, std::move(parameters)), options_(options) {}
  AdamOptions& options() { return options_; }  // schedules set learning_rate here

 private:
  void BeginStep(double gradient_scale) override;
  void Update(Slot& slot, const Tensor& gradient, Numbers numbers) override;
  void UpdateByProduct(Slot& slot, const Gradient& product) override;
  template <class T>
  AdamProblem<T> Problem(Slot& slot, Numbers numbers) const;
  AdamOptions options_;
  AdamCoefficients coefficients_;
};

struct SgdOptions {
  double learning_rate = 1e-2;
  double momentum = 0;      // in [0, 1)
  bool nesterov = false;    // looks ahead along the momentum
  double weight_decay = 0;  // times the parameter is added to the gradient, as for AdamOptions
};

// Stochastic gradient descent with momentum "v", as PyTorch writes it: v = momentum v + g,
// p = p - learning_rate v.
class Sgd : public Optimizer {
 public:
  Sgd(Context& context, std::vector<NamedVar> parameters, const SgdOptions& options)
      : Optimizer(context, "sgd", {"v"}, std::move(parameters)), options_(options) {}
  SgdOptions& options() { return options_; }

 private:
  void BeginStep(double gradient_scale) override { gradient_scale_ = gradient_scale; }
  void Update(Slot& slot, const Tensor& gradient, Numbers numbers) override;
  SgdOptions options_;
  double gradient_scale_ = 1;
};

// Square root of the sum of all squares, summed in double and in a fixed order. Not finite if a
// gradient is not: check it before a step.
double GlobalNorm(Context& context, std::span<const Var> gradients);
double GlobalNorm(Context& context, std::span<const Gradient> gradients);  // computes products
// Whether GlobalNorm is finite. Computes a product only if its factors are too large for the
// Cauchy-Schwarz inequality to decide.
bool IsFinite(Context& context, std::span<const Gradient> gradients);
// The factor that brings a norm above `max_norm` down to it: min(1, max_norm / norm).
double ClipFactor(double norm, double max_norm);

}  // namespace tilegrad::nn
