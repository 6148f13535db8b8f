// SPDX-License-Identifier: Apache-2.0
// Several threads in one context: what they share, and what each has by itself.
#include <gtest/gtest.h>

#include <atomic>
#include <set>
#include <stdexcept>

#include "base/error.h"
#include "nn/nn.h"
#include "support/expect.h"

namespace tilegrad::nn::lanes_test {

struct Net {
  explicit Net(Context& c) : context(c) {
    Rng rng(1);
    net.Add<Conv2dLayer>("conv", context, ConvShape{3, 8, 3}, rng);
    net.Add<BatchNorm>("norm", context, 8, BatchNormOptions{.relu = true});
    net.Add<Flatten>("flatten");
    net.Add<LinearLayer>("last", context, LinearShape{.in = 8 * 36, .out = 5}, rng);
    for (const NamedVar& p : Parameters(net)) parameters.push_back(p.value);
  }
  // Bits of the gradients, then of the statistics that the pass leaves.
  std::vector<float> Pass(std::uint64_t input) {
    Rng rng(input, 7);
    Tensor image = context.Empty({4, 3, 8, 8});
    FillUniform(image, rng, 0, 1);
    const Var loss = Mean(Square(net.Forward(Constant(context, image), Mode::kTrain)));
    std::vector<float> out;
    const auto append = [&](const Tensor& t) {
      out.insert(out.end(), t.data<float>(), t.data<float>() + t.elements());
    };
    for (const Gradient& g : Gradients(loss, parameters)) append(g.Value().value());
    for (const NamedTensor& t : Buffers(net)) append(context.InLane(t.value));
    EXPECT_TRUE(context.TakeStatus().ok());
    return out;
  }
  Context& context;
  Sequential net;
  std::vector<Var> parameters;
};

TEST(Lanes, AreAsManyAsTheWorkersAndWhatIsAskedForAllow) {
  for (const auto& [workers, most, lanes] :
       {std::array{1, 4, 1}, {4, 1, 1}, {4, 2, 2}, {4, 9, 4}, {5, 3, 3}}) {
    const Workers all(workers);
    Context context(all);
    context.MakeLanes(static_cast<std::size_t>(most));
    EXPECT_EQ(context.lanes(), static_cast<std::size_t>(lanes));
    EXPECT_EQ(context.lane(), 0u);
    std::atomic<int> sum = 0;
    std::vector<std::size_t> places(context.lanes());
    context.ForEachLane([&](std::size_t i) {
      places[i] = context.lane();
      sum += context.workers().count();
    });
    EXPECT_EQ(sum, workers);
    const std::set<std::size_t> distinct(places.begin(), places.end());
    EXPECT_EQ(distinct.size(), places.size());
    EXPECT_EQ(context.lane(), 0u);
    EXPECT_EQ(&context.workers(), &all);
  }
}

TEST(Lanes, HaveTheBitsOfOneAfterTheOther) {
  const Workers one(1);
  Context alone(one);
  std::vector<std::vector<float>> want;
  for (std::uint64_t input = 0; input < 4; ++input) want.push_back(Net(alone).Pass(input));
  for (const int count : {2, 4, 16}) {
    const Workers workers(count);
    Context context(workers);
    context.MakeLanes(4);
    Net net(context);
    context.CopyForLanes(Buffers(net.net));
    const std::size_t lanes = context.lanes();
    std::vector<std::vector<float>> got(4);
    context.ForEachLane([&](std::size_t i) { got[i] = net.Pass(i); });
    for (std::size_t i = 0; i < lanes; ++i) EXPECT_EQ(got[i], want[i]) << i << " of " << count;
    for (const float x : State(net.net)[2].value.span<float>()) EXPECT_EQ(x, 1);  // norm.weight
    for (const NamedTensor& t : Buffers(net.net)) {
      const float start = t.name == "norm.running_var" ? 1 : 0;
      for (const float x : t.value.span<float>()) EXPECT_EQ(x, start) << t.name;  // untouched
    }
  }
}

TEST(Lanes, HaveErrorsAndRecordingOfTheirOwn) {
  const Workers workers(2);
  Context context(workers);
  context.MakeLanes(2);
  context.ForEachLane([&](std::size_t i) {
    EXPECT_TRUE(context.recording());
    const NoGrad off(context);
    if (i == 1) context.Fail(InvalidArgument("lane {}", i));
    EXPECT_EQ(context.status().ok(), i == 0);
    EXPECT_FALSE(context.recording());
  });
  EXPECT_TRUE(context.recording());
  EXPECT_TRUE(context.status().ok());
  std::vector<Status> said(2);
  context.ForEachLane([&](std::size_t i) { said[i] = context.TakeStatus(); });
  EXPECT_TRUE(said[0].ok());
  ExpectMessage(said[1], "lane 1");
}

TEST(Lanes, AThreadLeavesItsLaneByAnExceptionToo) {
  const Workers workers(2);
  Context context(workers);
  context.MakeLanes(2);
  EXPECT_THROW(context.ForEachLane([](std::size_t) { throw std::runtime_error("out"); }),
               std::runtime_error);
  EXPECT_EQ(context.lane(), 0u);
}

struct Counted {
  explicit Counted(const Workers& w) : workers(&w) {}
  const Workers* workers;
  int uses = 0;
};

TEST(PerLane, IsOneForEachAndOneOutside) {
  const Workers workers(3);
  Context context(workers);
  context.MakeLanes(3);
  PerLane<Counted> things(context);
  for (int round = 0; round < 2; ++round) {
    context.ForEachLane([&](std::size_t) {
      ++things.Here().uses;
      EXPECT_EQ(things.Here().workers, &context.workers());
    });
  }
  EXPECT_EQ(things.Here().uses, 0);
  EXPECT_EQ(things.Here().workers, &workers);
  context.ForEachLane([&](std::size_t) { EXPECT_EQ(things.Here().uses, 2); });
}

}  // namespace tilegrad::nn::lanes_test
