// SPDX-License-Identifier: Apache-2.0
// A training step like the one before allocates nothing: tensors come from the context's pool,
// graph nodes and lists from its step memory, and scratch is kept.
#include <gtest/gtest.h>

#include "base/sanitizers.h"
#include "nn/game.h"
#include "support/allocation_count.h"
#include "support/expect.h"

namespace tilegrad::nn::allocation_test {

using test::g_allocations;

// How often steps 3 to 8 allocate; the first two may take memory.
template <class Step>
long AllocationsLater(const Step& step) {
  const long first = g_allocations;
  step(0);
  EXPECT_GT(g_allocations, first);  // the counter counts
  step(1);
  const long before = g_allocations;
  for (std::uint64_t i = 2; i < 8; ++i) step(i);
  return g_allocations - before;
}

template <class Network>
long AllocationsOfTraining(Context& context, Network& net, const Shape& input) {
  Adam adam(context, Parameters(net), {.learning_rate = 1e-3});
  Rng rng(5);
  Tensor image = context.Empty(input);
  FillUniform(image, rng, 0, 1);
  const Var x = Constant(context, image);
  return AllocationsLater([&](std::uint64_t) {
    const Var loss = Mean(Square(net.Forward(x, Mode::kTrain)));
    Ok(adam.Step(Gradients(loss, adam.parameters())));
  });
}

class Allocation : public testing::TestWithParam<int> {};

TEST_P(Allocation, NoneInTheGame) {
  const Workers workers(GetParam());
  Game game(workers);
  EXPECT_EQ(AllocationsLater([&](std::uint64_t i) { game.Step(i); }), 0);
}

TEST_P(Allocation, NoneInAnEncoder) {
  const Workers workers(GetParam());
  Context context(workers);
  Rng rng(1);
  Sequential net;
  const ConvOptions halve{.stride = 2, .padding = 2};
  net.Add<Conv2dLayer>("conv1", context, ConvShape{4, 16, 5, halve}, rng);
  net.Add<BatchNorm>("bn1", context, 16, BatchNormOptions{.relu = true});
  net.Add<Conv2dLayer>("conv2", context, ConvShape{16, 32, 5, halve}, rng);
  net.Add<Flatten>("flatten");
  net.Add<LinearLayer>("fc1", context, LinearShape{.in = 512, .out = 40}, rng);
  net.Add<BatchNorm>("bn2", context, 40, BatchNormOptions{.relu = true});
  net.Add<LinearLayer>("fc2", context, LinearShape{.in = 40, .out = 9}, rng);
  EXPECT_EQ(AllocationsOfTraining(context, net, {3, 4, 16, 16}), 0);
}

// Lanes share weights; memory and statistics are their own.
TEST_P(Allocation, NoneInLanes) {
  const Workers workers(GetParam());
  Context context(workers);
  context.MakeLanes(2);
  Rng rng(1);
  Sequential net;
  net.Add<Conv2dLayer>("conv", context, ConvShape{3, 8, 3}, rng);
  net.Add<BatchNorm>("norm", context, 8, BatchNormOptions{.relu = true});
  context.CopyForLanes(Buffers(net));
  std::vector<Var> parameters;
  for (const NamedVar& p : Parameters(net)) parameters.push_back(p.value);
  const auto step = [&](std::uint64_t number) {
    context.ForEachLane([&](std::size_t i) {
      Rng of_lane(number, i);
      Tensor image = context.Empty({3, 3, 16, 16});
      FillUniform(image, of_lane, 0, 1);
      const Var loss = Mean(Square(net.Forward(Constant(context, image), Mode::kTrain)));
      EXPECT_EQ(Gradients(loss, parameters).size(), parameters.size());
      EXPECT_TRUE(context.TakeStatus().ok());
    });
  };
  EXPECT_EQ(AllocationsLater(step), 0);
}

INSTANTIATE_TEST_SUITE_P(Workers, Allocation, testing::Range(1, kThreadSanitizer ? 2 : 3));

}  // namespace tilegrad::nn::allocation_test
