// SPDX-License-Identifier: Apache-2.0
// The gradient of a gradient (the penalty of WGAN-GP), and training steps.
#include <cmath>

#include "base/hash.h"
#include "nn/nn.h"
#include "proof/selftest/check.h"

namespace tilegrad::selftest {
namespace {

using nn::Context;
using nn::Var;

// A critic with enough channels for the SIMD kernels and Winograd's algorithm, and images for it.
struct PenaltyCase {
  Context context;
  Rng rng{9, 25};
  nn::Critic critic;
  Var images;

  PenaltyCase(const Workers& workers, nn::DType dtype)
      : context(workers, dtype), critic(context, {.base = 16, .halvings = 2}, rng) {
    const nn::Shape shape = {2, 3, 16, 16};
    std::vector<float> numbers(static_cast<std::size_t>(shape.elements()));
    Rng own(10, 25);
    for (float& x : numbers) x = static_cast<float>(own.Uniform(0, 1));
    images = nn::Constant(context, context.From(shape, numbers));
  }
  Var Penalty() { return nn::GradientPenalty(critic, images); }
  std::vector<Var> Parameters() {
    std::vector<Var> out;
    for (const auto& p : nn::Parameters(critic)) out.push_back(p.value);
    return out;
  }
};

// In double, for a critic with the float one's numbers.
struct TrueCase : PenaltyCase {
  explicit TrueCase(const Workers& workers) : PenaltyCase(workers, nn::DType::kF64) {}
  Status TakeFrom(PenaltyCase& single) { return LoadState(critic, nn::State(single.critic)); }
};

// dL/d(each parameter), one list for each.
Result<std::vector<std::vector<double>>> PenaltyGradient(PenaltyCase& at) {
  const auto gradients = nn::Grad(at.Penalty(), at.Parameters());
  TILEGRAD_TRY(at.context.TakeStatus());
  std::vector<std::vector<double>> out;
  for (const Var& d : gradients) {
    nn::WithFloatType(d.dtype(), [&](auto type) {
      const auto values = d.value().template span<decltype(type)>();
      out.emplace_back(values.begin(), values.end());
    });
  }
  return out;
}

// The penalty after moving all parameters by `step` along a random direction; restores them.
double PenaltyAlong(TrueCase& at, double step) {
  const auto move = [&](double by) {
    Rng rng(11, 25);
    for (Var& p : at.Parameters()) {
      for (double& x : p.value().span<double>()) x += by * rng.Uniform(-1, 1);
    }
  };
  move(step);
  const double penalty = at.Penalty().item();
  move(-step);
  return penalty;
}

// The slope along the direction of PenaltyAlong, by the gradient.
double SlopeOf(const std::vector<std::vector<double>>& gradient) {
  Rng rng(11, 25);
  double sum = 0;
  for (const auto& d : gradient) {
    for (const double x : d) sum += x * rng.Uniform(-1, 1);
  }
  return sum;
}

// The step is small because none of the thousand rectifiers may pass its kink: 1e-6. The
// difference of two penalties rounds by 16 eps |penalty|, which the step divides; 1e-6 of the
// slope is for curvature.
Result<Finding> PenaltyIsTheDifference(const CheckContext& context) {
  constexpr double kStep = 1e-6;
  TrueCase at(context.workers);
  TILEGRAD_ASSIGN(auto gradient, PenaltyGradient(at));
  for (auto& d : gradient) context.Take("gradient", d);
  const double difference = (PenaltyAlong(at, kStep) - PenaltyAlong(at, -kStep)) / (2 * kStep);
  const double rounding = 16 * 0x1.0p-52 * std::abs(at.Penalty().item()) / kStep;
  const double got[] = {SlopeOf(gradient)}, want[] = {difference};
  Gauge gauge;
  TILEGRAD_TRY(
      gauge.Expect("slope of the penalty", got, want, 1e-6 * std::abs(difference) + rounding));
  return gauge.Found();
}

// A number passes about 600 roundings: sums of up to 512 products, and three times so, since the
// gradient of a gradient goes through the network three times. 600 * 3 * 2^-24 of the largest.
constexpr double kFloatShare = 1.1e-4;

Result<Finding> PenaltyInFloat(const CheckContext& context) {
  PenaltyCase single(context.workers, nn::DType::kF32);
  TrueCase truth(context.workers);
  TILEGRAD_TRY(truth.TakeFrom(single));
  TILEGRAD_ASSIGN(auto got, PenaltyGradient(single));
  TILEGRAD_ASSIGN(const auto want, PenaltyGradient(truth));
  const auto names = nn::Parameters(single.critic);
  Gauge gauge;
  for (std::size_t i = 0; i < want.size(); ++i) {
    context.Take("d_" + names[i].name, got[i]);
    // The critic is linear between the kinks of its rectifiers: biases do not change its slope.
    const bool zero = names[i].name.ends_with("bias");
    TILEGRAD_TRY(zero ? gauge.Expect("d_" + names[i].name, got[i], want[i], 0)
                      : gauge.ExpectOfLargest("d_" + names[i].name, got[i], want[i], kFloatShare));
  }
  return gauge.Found();
}

class ToImage : public nn::Module {
 public:
  Var Forward(const Var& x, nn::Mode) override { return nn::Reshape(x, {-1, 3, 16, 16}); }
  void Visit(const std::string&, nn::ModuleVisitor&) override {}
};

// Images of 3 x 16 x 16 from nine numbers each.
nn::Sequential MakeGenerator(Context& context, Rng& rng) {
  nn::Sequential net;
  nn::AddLinear(net, "code", context, 9, 3 * 16 * 16, rng);
  net.Add<ToImage>("image");
  net.Add<nn::UNet>("paint", context,
                    nn::UNetShape{.base = 16, .levels = 2, .output = &nn::Sigmoid}, rng);
  return net;
}

// A small adversarial game, as in `tilegrad train`: Wasserstein loss with penalty, Adam.
class Game {
 public:
  explicit Game(const Workers& workers)
      : context_(workers),
        generator_(MakeGenerator(context_, rng_)),
        critic_(context_, {.base = 16, .halvings = 2}, rng_),
        for_generator_(context_, nn::Parameters(generator_), {}),
        for_critic_(context_, nn::Parameters(critic_), {}) {}

  Status Step(std::uint64_t step) {
    Rng rng(12, step);
    const Var noise = Random({3, 9}, rng), real = Random({3, 3, 16, 16}, rng);
    const Var fake = generator_.Forward(noise, nn::Mode::kTrain);
    const Var worth = Mean(critic_.Forward(nn::Detach(fake), nn::Mode::kTrain)) -
                      Mean(critic_.Forward(real, nn::Mode::kTrain)) +
                      10.0 * GradientPenalty(critic_, real);
    TILEGRAD_TRY(for_critic_.Step(nn::Gradients(worth, for_critic_.parameters())));
    const Var loss = 0.0 - Mean(critic_.Forward(fake, nn::Mode::kTrain));
    return for_generator_.Step(nn::Gradients(loss, for_generator_.parameters()));
  }

  std::vector<float> Weights() {
    std::vector<float> out;
    for (nn::Module* module :
         {static_cast<nn::Module*>(&generator_), static_cast<nn::Module*>(&critic_)}) {
      for (const auto& p : nn::Parameters(*module)) {
        const auto numbers = p.value.value().span<float>();
        out.insert(out.end(), numbers.begin(), numbers.end());
      }
    }
    return out;
  }

 private:
  Var Random(const nn::Shape& shape, Rng& rng) {
    nn::Tensor t = context_.Empty(shape);
    nn::FillUniform(t, rng, 0, 1);
    return nn::Constant(context_, t);
  }

  Context context_;
  Rng rng_{13, 25};
  nn::Sequential generator_;
  nn::Critic critic_;
  nn::Adam for_generator_, for_critic_;
};

Result<Finding> SameBitsOfTraining(const CheckContext& context) {
  std::vector<float> first;
  for (const int count : {1, 2, 7}) {
    const Workers workers(count);
    Game game(workers);
    const auto before = game.Weights();
    for (std::uint64_t step = 0; step < 3; ++step) TILEGRAD_TRY(game.Step(step));
    auto weights = game.Weights();
    if (weights == before) return InternalError("training changed no weight");
    if (first.empty()) first = weights;
    context.Take("weights", weights);
    TILEGRAD_TRY(ExpectSameBits("weight", weights, first).Within(fmt::format("{} workers", count)));
  }
  Hash hash;
  hash.AddAll(first);
  return Finding{"1, 2, 7 threads agree", 0, hash.Text().substr(0, 8)};
}

}  // namespace

std::vector<Check> TrainingChecks() {
  return {
      {"networks: gradient penalty, float64, differences", PenaltyIsTheDifference},
      OnEveryTarget({"networks: gradient penalty, beside float64", PenaltyInFloat}),
      OnEveryTarget({"networks: same bits of training", SameBitsOfTraining}),
  };
}

}  // namespace tilegrad::selftest
