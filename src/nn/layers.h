// SPDX-License-Identifier: Apache-2.0
// Layers with named parameters and buffers, and modules composed of them.
//
//   Sequential net;
//   net.Add<Conv2dLayer>("conv1", context, ConvShape{.in = 4, .out = 64, .kernel = 5}, rng);
//   net.Add<BatchNorm>("bn1", context, 64, BatchNormOptions{.relu = true});
//   Var y = net.Forward(x, Mode::kTrain);
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/rng.h"
#include "nn/ops.h"
#include "nn/tape.h"
#include "nn/tensor.h"

namespace tilegrad::nn {

enum class Mode { kTrain, kEval };  // for batch norm: statistics of the batch, or the running ones

struct NamedVar {
  std::string name;
  Var value;
};

// Visits every parameter (trained) and every buffer (saved, not trained) of a module.
class ModuleVisitor {
 public:
  virtual ~ModuleVisitor() = default;
  virtual void Parameter(const std::string& name, Var& value) = 0;
  virtual void Buffer(const std::string& name, Tensor& value) = 0;
};

class Module {
 public:
  virtual ~Module() = default;
  // Errors: as for operations, see Context.
  virtual Var Forward(const Var& x, Mode mode) = 0;
  // Names begin with `prefix`, which is empty or ends in '.'. The order is fixed.
  virtual void Visit(const std::string& prefix, ModuleVisitor& visitor) = 0;
};

std::vector<NamedVar> Parameters(Module& module);
// Parameters and buffers: the contents of a checkpoint.
std::vector<NamedTensor> State(Module& module);
// Only what a pass in training mode changes: running statistics.
std::vector<NamedTensor> Buffers(Module& module);
std::int64_t CountParameters(Module& module);
// Copies by name (CopyByName) into parameters and buffers.
Status LoadState(Module& module, const std::vector<NamedTensor>& state);

struct LinearShape {
  std::int64_t in = 0, out = 0;
  bool bias = true;
};

class WeightedLayer : public Module {
 public:
  void Visit(const std::string& prefix, ModuleVisitor& visitor) override;

  Var weight;  // [out, in], or [out, in, kernel, kernel]
  Var bias;    // [out]; invalid if there is none
};

class LinearLayer : public WeightedLayer {
 public:
  LinearLayer(Context& context, const LinearShape& shape, Rng& rng);  // FillDefault
  Var Forward(const Var& x, Mode mode) override;                      // [n, in] -> [n, out]
};

struct ConvShape {
  std::int64_t in = 0, out = 0;
  int kernel = 3;
  ConvOptions options = {};
  bool bias = true;
};

class Conv2dLayer : public WeightedLayer {
 public:
  // FillDefault with the fan-in of the weight's shape.
  Conv2dLayer(Context& context, const ConvShape& shape, Rng& rng);
  Var Forward(const Var& x, Mode mode) override;

 private:
  ConvOptions options_;
};

// For [n, c] and [n, c, h, w]. Running statistics as in PyTorch: new = (1 - momentum) old +
// momentum batch, with the unbiased variance; within a lane, those of the lane's copy, if any.
class BatchNorm : public Module {
 public:
  BatchNorm(Context& context, std::int64_t channels, const BatchNormOptions& options = {});
  Var Forward(const Var& x, Mode mode) override;
  void Visit(const std::string& prefix, ModuleVisitor& visitor) override;

  static constexpr double kMomentum = 0.1;
  Var weight, bias;                       // initially gamma 1, beta 0
  Tensor running_mean, running_variance;  // initially 0 and 1

 private:
  void Track(const BatchNormResult& batch, std::int64_t count);
  BatchNormOptions options_;
};

class Activation : public Module {
 public:
  using Function = Var (*)(const Var&);
  explicit Activation(Function function) : function_(function) {}  // e.g. &Relu
  Var Forward(const Var& x, Mode) override { return function_(x); }
  void Visit(const std::string&, ModuleVisitor&) override {}

 private:
  Function function_;
};

// [n, ...] -> [n, product of the rest].
class Flatten : public Module {
 public:
  Var Forward(const Var& x, Mode mode) override;
  void Visit(const std::string&, ModuleVisitor&) override {}
};

// Runs modules in sequence.
class Sequential : public Module {
 public:
  template <class M, class... A>
  M& Add(const std::string& name, A&&... arguments) {
    auto module = std::make_unique<M>(std::forward<A>(arguments)...);
    M& reference = *module;
    children_.emplace_back(name, std::move(module));
    return reference;
  }
  Var Forward(const Var& x, Mode mode) override;
  void Visit(const std::string& prefix, ModuleVisitor& visitor) override;
  std::size_t size() const { return children_.size(); }

 private:
  std::vector<std::pair<std::string, std::unique_ptr<Module>>> children_;
};

// y = x + body(x) (He et al. 2016).
class Residual : public Module {
 public:
  Var Forward(const Var& x, Mode mode) override;
  void Visit(const std::string& prefix, ModuleVisitor& visitor) override;

  Sequential body;
};

// Parameter initialisation. The caller provides the random stream, so equal seeds give equal
// networks for any number of workers.

void FillConstant(Tensor& tensor, double value);
void FillNormal(Tensor& tensor, Rng& rng, double deviation);          // N(0, deviation^2)
void FillUniform(Tensor& tensor, Rng& rng, double low, double high);  // [low, high)

// PyTorch's default for linear and convolution weights and their biases: uniform in
// +-1/sqrt(fan_in) (He et al. 2015 with a = sqrt 5).
void FillDefault(Tensor& tensor, Rng& rng, std::int64_t fan_in);

// Building blocks of networks.

// Adds convolution, batch norm and activation to `net` as "<name>.conv", "<name>.norm",
// "<name>.act". A convolution followed by a norm has no bias, which the norm would cancel.
struct ConvBlock {
  ConvShape conv;
  bool norm = false;
  Activation::Function activation = nullptr;
};
void AddConvBlock(Sequential& net, const std::string& name, Context& context,
                  const ConvBlock& block, Rng& rng);

LinearLayer& AddLinear(Sequential& net, const std::string& name, Context& context, std::int64_t in,
                       std::int64_t out, Rng& rng);

Var LeakyRelu02(const Var& x);  // LeakyRelu of slope 0.2, as an Activation

}  // namespace tilegrad::nn
