// SPDX-License-Identifier: Apache-2.0
#include "training_steps.h"

#include <string>
#include <utility>
#include <vector>

#include "nn/nn.h"

namespace tilegrad::nn::bench {
namespace {

Var RandomImages(Context& context, const Shape& shape, std::uint64_t seed) {
  Rng rng(seed);
  Tensor images = context.Empty(shape);
  FillUniform(images, rng, 0, 1);
  return Constant(context, images);
}

Var Twice(const Var& x) {
  return Resize(x, {2 * x.shape()[2], 2 * x.shape()[3]}, ResizeMode::kNearest);
}

// A network, its optimiser and its loss.
template <class Network>
class StepOf : public TrainingStep {
 public:
  explicit StepOf(Context& context)
      : network_(context), adam_(context, network_.All(), {.learning_rate = 1e-4}) {}
  Status Run() override {
    const Var loss = network_.Loss();
    const Status status = adam_.Step(Gradients(loss, adam_.parameters()));
    loss_ = loss.item();
    return status;
  }
  double loss() const override { return loss_; }

 private:
  Network network_;
  Adam adam_;
  double loss_ = 0;
};

class Reconstruction {
 public:
  explicit Reconstruction(Context& context)
      : image_(RandomImages(context, {kBatch, 4, kImage, kImage}, 2)) {
    Rng rng(1);
    const std::int64_t channels[] = {4, 64, 128, 256};
    for (std::size_t i = 0; i < 3; ++i) {
      const ConvShape conv{channels[i], channels[i + 1], 5, {.stride = 2, .padding = 2}};
      encoder_.Add<Conv2dLayer>("conv" + std::to_string(i), context, conv, rng);
      encoder_.Add<BatchNorm>("bn" + std::to_string(i), context, channels[i + 1],
                              BatchNormOptions{.relu = true});
    }
    encoder_.Add<Flatten>("flatten");
    AddDense(encoder_, context, {16384, 1024, 1024, 1024}, rng);
    AddDense(shape_, context, {1024, 1024, 2048, kOutputs}, rng);
    AddDense(color_, context, {1024, 1024, 2048, kOutputs}, rng);
  }

  std::vector<NamedVar> All() {
    std::vector<NamedVar> all;
    for (Module* module : {&encoder_, &shape_, &color_}) {
      for (NamedVar& p : Parameters(*module)) all.push_back(std::move(p));
    }
    return all;
  }

  Var Loss() {
    const Var code = encoder_.Forward(image_, Mode::kTrain);
    return Mean(Square(shape_.Forward(code, Mode::kTrain))) +
           Mean(Square(color_.Forward(code, Mode::kTrain)));
  }

 private:
  static constexpr std::int64_t kBatch = 64, kImage = 64, kOutputs = 642 * 3;

  // Layer after layer with batch norm and ReLU but after the last.
  static void AddDense(Sequential& net, Context& context, const std::vector<std::int64_t>& widths,
                       Rng& rng) {
    for (std::size_t i = 1; i < widths.size(); ++i) {
      const std::string number = std::to_string(i);
      net.Add<LinearLayer>("fc" + number, context, LinearShape{widths[i - 1], widths[i]}, rng);
      if (i + 1 == widths.size()) break;
      net.Add<BatchNorm>("fc_bn" + number, context, widths[i], BatchNormOptions{.relu = true});
    }
  }

  Var image_;
  Sequential encoder_, shape_, color_;
};

class Judge {
 public:
  Judge(Context& context, const Shape& images, const CriticShape& critic)
      : real_(RandomImages(context, images, 2)),
        fake_(RandomImages(context, images, 3)),
        net_(context, critic, rng_) {}
  std::vector<NamedVar> All() { return Parameters(net_); }
  Var Loss() {
    return Mean(net_.Forward(fake_, Mode::kTrain)) - Mean(net_.Forward(real_, Mode::kTrain)) +
           10.0 * GradientPenalty(net_, 0.5 * real_ + 0.5 * fake_);
  }
  Critic& net() { return net_; }

 private:
  Var real_, fake_;
  Rng rng_{1};
  Critic net_;
};

struct LargeJudge : Judge {
  explicit LargeJudge(Context& context) : Judge(context, {32, 3, 64, 64}, {}) {}
};
struct SmallJudge : Judge {
  explicit SmallJudge(Context& context) : Judge(context, {24, 3, 64, 64}, {.base = 32}) {}
};

// Both critics and the generator of maps.
class Forger {
 public:
  explicit Forger(Context& context)
      : noise_(RandomImages(context, {kBatch, 64}, 4)),
        pictures_(context, {kBatch, 18, 64, 64}, {.in = 18, .base = 24}),
        maps_(context, {kBatch, 3, 128, 64}, {.base = 24, .padding_mode = PadMode::kReplicate}) {
    net_.Add<LinearLayer>("fc", context, LinearShape{64, kRoot * 8 * 4}, rng_);
    for (std::int64_t level = 0, in = kRoot; level < 4; ++level, in /= 2) {
      const std::string name = "up" + std::to_string(level);
      const bool last = level == 3;
      up_.Add<Activation>(name + ".resize", &Twice);
      AddConvBlock(up_, name, context,
                   {.conv = {.in = in, .out = last ? 3 : in / 2, .options = {.padding = 1}},
                    .norm = !last,
                    .activation = last ? &Sigmoid : &LeakyRelu02},
                   rng_);
    }
  }

  std::vector<NamedVar> All() {
    std::vector<NamedVar> all;
    for (Module* module : std::initializer_list<Module*>{&net_, &up_}) {
      for (NamedVar& p : Parameters(*module)) all.push_back(std::move(p));
    }
    for (Judge* judge : {&pictures_, &maps_}) {
      for (NamedVar& p : judge->All()) all.push_back(std::move(p));
    }
    return all;
  }
  Var Loss() {
    const Var root = Reshape(net_.Forward(noise_, Mode::kTrain), {kBatch, kRoot, 8, 4});
    const Var made = up_.Forward(root, Mode::kTrain);
    return pictures_.Loss() + maps_.Loss() - Mean(maps_.net().Forward(made, Mode::kTrain));
  }

 private:
  static constexpr std::int64_t kBatch = 16, kRoot = 128;
  Var noise_;
  Rng rng_{1};
  Sequential net_, up_;
  Judge pictures_, maps_;
};

}  // namespace

std::unique_ptr<TrainingStep> MakeTrainingStep(std::string_view name, Context& context) {
  if (name == "reconstruction") return std::make_unique<StepOf<Reconstruction>>(context);
  if (name == "critic") return std::make_unique<StepOf<LargeJudge>>(context);
  if (name == "adversarial") return std::make_unique<StepOf<SmallJudge>>(context);
  if (name == "gan") return std::make_unique<StepOf<Forger>>(context);
  return nullptr;
}

}  // namespace tilegrad::nn::bench
