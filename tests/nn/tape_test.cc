// SPDX-License-Identifier: Apache-2.0
// The tape itself: what is released when, errors, external operations.
#include "nn/tape.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "base/aligned.h"
#include "base/rng.h"
#include "nn/memory.h"
#include "nn/nn.h"
#include "support/expect.h"

namespace tilegrad::nn::tape_test {

class Tape : public ::testing::Test {
 protected:
  Var Vector(std::vector<double> values) {
    const auto n = static_cast<std::int64_t>(values.size());
    return Parameter(context_, context_.From({n}, values));
  }
  std::string Message() { return context_.TakeStatus().message(); }
  void ExpectRefused(const Var& y, const char* word) {
    EXPECT_FALSE(y.valid()) << word;
    ExpectIn(Message(), word);
  }

  Workers workers_{1};
  Context context_{workers_, DType::kF64};
};

TEST_F(Tape, UsesAddUp) {
  const Var x = Vector({3});
  const Var y = x * x + x;                    // 2 x + 1
  EXPECT_EQ(Grad(y * x, {x})[0].item(), 33);  // d(x^3 + x^2) = 3 x^2 + 2 x
}

TEST_F(Tape, AnyOrder) {
  const Var x = Vector({0.5});
  Var y = Exp(2.0 * x);
  for (int order = 1; order <= 5; ++order) {
    y = Grad(y, {x}, {.create_graph = true})[0];
    EXPECT_NEAR(y.item(), std::pow(2, order) * std::exp(1.0), 1e-12) << order;
  }
}

TEST_F(Tape, WhatOutputDoesNotDependOnHasGradientZero) {
  const Var x = Vector({1, 2}), other = Vector({1, 2, 3});
  const auto d = Grad(Sum(x), {other, x});
  EXPECT_EQ(d[0].shape(), (Shape{3}));
  EXPECT_EQ(d[0].value().data<double>()[2], 0);
  EXPECT_EQ(d[1].value().data<double>()[1], 1);
}

std::vector<double> Numbers(const Var& v) {
  const auto numbers = v.value().span<double>();
  return {numbers.begin(), numbers.end()};
}

// Rules may overwrite an adjoint, but not one that is still shared.
TEST_F(Tape, AdjointsThatOthersSeeAreLeftAlone) {
  const Var x = Vector({-1, 2}), u = Vector({-4, 8});
  const Var y = LeakyRelu(x, 0.5);
  const auto asked = Grad(Sum(Square(y)), {y, x});
  EXPECT_EQ(Numbers(asked[0]), (std::vector<double>{-1, 4}));
  EXPECT_EQ(Numbers(asked[1]), (std::vector<double>{-0.5, 4}));

  const auto shared = Grad(Sum(LeakyRelu(x, 0.5) + LeakyRelu(u, 0.25)), {x, u});
  EXPECT_EQ(Numbers(shared[0]), (std::vector<double>{0.5, 1}));
  EXPECT_EQ(Numbers(shared[1]), (std::vector<double>{0.25, 1}));

  const Var d = Constant(context_, context_.From({2}, std::vector<double>{10, 100}));
  const auto given = Grad(LeakyRelu(x, 0.5), {x}, {.d_output = d});
  EXPECT_EQ(Numbers(given[0]), (std::vector<double>{5, 100}));
  EXPECT_EQ(Numbers(d), (std::vector<double>{10, 100}));

  const auto summed = Grad(LeakyRelu(x, 0.5) + x, {x}, {.d_output = d});
  EXPECT_EQ(Numbers(summed[0]), (std::vector<double>{15, 200}));
  EXPECT_EQ(Numbers(d), (std::vector<double>{10, 100}));
}

// Their adjoints are added into one sum, which a value that others see must not be.
TEST_F(Tape, AdjointsOfSlicesAddUp) {
  const Var x = Vector({1, 2, 3, 4, 5});
  const auto use = [](const Var& v) {
    const Var all = Square(v);
    return Sum(Slice(all, 0, 0, 2)) + 2.0 * Sum(Slice(all, 0, 1, 4)) + Sum(v) +
           3.0 * Sum(Slice(v, 0, 4, 5));
  };
  const std::vector<double> expected = {3, 13, 13, 17, 4};  // 2 x (1, 3, 2, 2, 0) + (1, .., 1, 4)
  const std::vector<Var> parameters = {x};
  EXPECT_EQ(Numbers(Gradients(use(x), parameters)[0].Value()), expected);
  EXPECT_EQ(Numbers(Grad(use(x), {x}, {.create_graph = true})[0]), expected);
}

TEST_F(Tape, ErrorsAreNotedAndSpread) {
  const Var a = Vector({1, 2}), b = Vector({1, 2, 3});
  const Var y = Exp(Add(a, b));
  EXPECT_FALSE(y.valid());
  EXPECT_TRUE(std::isnan(Sum(y).item()));
  EXPECT_FALSE(Grad(Sum(y), {a})[0].valid());
  EXPECT_EQ(Message(), "add: shapes [2] and [3] do not broadcast");
  EXPECT_TRUE(context_.status().ok());

  ExpectRefused(Grad(a, {a})[0], "give d_output");
  ExpectRefused(Matmul(a, b), "matmul: [2] by [3]");
  ExpectRefused(Reshape(a, {3}), "reshape");
  ExpectRefused(LeakyRelu(a, -0.1), "slope -0.1");
  ExpectRefused(Mean(Slice(a, 0, 1, 1)), "nothing to average");
  ExpectRefused(Sum(a, {1}), "axis 1");
  ExpectRefused(Conv2d(a, b, Var(), {}), "conv2d");
}

TEST_F(Tape, ReleasedGraphIsAnError) {
  const Var x = Vector({2});
  const Var y = Square(x);
  EXPECT_EQ(Grad(y, {x}, {.keep_graph = true})[0].item(), 4);
  EXPECT_EQ(Grad(y, {x})[0].item(), 4);
  ExpectRefused(Grad(y, {x})[0], "was released");
}

// Recursive destruction of nodes would overflow the stack.
TEST_F(Tape, DeepChainsAreTakenApart) {
  const Var x = Vector({1});
  Var y = x;
  for (int i = 0; i < 400000; ++i) y = y + 1.0;
  EXPECT_EQ(Grad(y, {x})[0].item(), 1);
  y = x;
  for (int i = 0; i < 400000; ++i) y = y * y;
  y = Var();
}

TEST_F(Tape, NoGradRecordsNothing) {
  const Var x = Vector({2});
  {
    const NoGrad off(context_);
    EXPECT_FALSE(Square(x).requires_grad());
  }
  EXPECT_TRUE(Square(x).requires_grad());
  EXPECT_FALSE(Square(Detach(x)).requires_grad());
}

// A chain of n operations holds n values while it is recorded; the backward pass releases each as
// soon as its rule has run, so the peak is the chain and a few adjoints, not twice the chain.
TEST_F(Tape, ValuesAreReleasedOnTheWayBack) {
  const std::int64_t n = 1 << 16;
  const std::size_t bytes = static_cast<std::size_t>(n) * sizeof(double);
  const Var x = Parameter(context_, context_.Full({n}, 0.1));
  Var y = x;
  for (int i = 0; i < 20; ++i) y = Exp(Scale(y, 0.5));
  const Var loss = Sum(y);
  y = Var();
  // Exp keeps its output for its rule; Scale keeps nothing.
  EXPECT_LE(context_.memory().stats().live_bytes, 22 * bytes);
  context_.memory().ResetPeak();
  Grad(loss, {x});
  EXPECT_LE(context_.memory().stats().peak_bytes, 25 * bytes);
  EXPECT_LE(context_.memory().stats().live_bytes, 2 * bytes);
}

// (u, v) -> (u v, u + v), whose adjoint is written by hand.
std::vector<Var> ProductAndSum(Context& context, const Var& u, const Var& v) {
  const auto value = [](const Var& x) { return x.item(); };
  const auto scalar = [&context](double x) { return context.Full({}, x); };
  ExternalOp op;
  op.name = "product and sum";
  op.inputs = {u, v};
  op.outputs = {scalar(value(u) * value(v)), scalar(value(u) + value(v))};
  op.backward = [=](std::span<const Tensor> d) {
    const auto at = [](const Tensor& t) { return t.empty() ? 0.0 : *t.data<double>(); };
    return std::vector<Tensor>{scalar(at(d[0]) * value(v) + at(d[1])),
                               scalar(at(d[0]) * value(u) + at(d[1]))};
  };
  return External(context, std::move(op));
}

TEST_F(Tape, ExternalOperations) {
  const Var u = Parameter(context_, context_.Full({}, 3)),
            v = Parameter(context_, context_.Full({}, 5));
  auto out = ProductAndSum(context_, u, v);
  auto d = Grad(Square(out[0]) + out[1], {u, v});  // 2 u v v + 1, 2 u v u + 1
  EXPECT_EQ(d[0].item(), 151);
  EXPECT_EQ(d[1].item(), 91);
  out = ProductAndSum(context_, u, v);
  EXPECT_EQ(Grad(out[1], {u})[0].item(), 1);  // the other output has no adjoint
}

TEST_F(Tape, ExternalOperationsRefuseASecondDerivative) {
  const Var u = Parameter(context_, context_.Full({}, 3)),
            v = Parameter(context_, context_.Full({}, 5));
  const auto out = ProductAndSum(context_, u, v);
  const auto d = Grad(out[0], {u}, {.create_graph = true});
  EXPECT_EQ(d[0].item(), 5);
  EXPECT_FALSE(Grad(Square(d[0]), {v})[0].valid());
  EXPECT_EQ(Message(), "product and sum has a first derivative only");
}

TEST(Memory, TensorsMayOutliveTheirContext) {
  Tensor survivor;
  {
    const Workers workers(1);
    const Context context(workers);
    survivor = context.Full({3}, 2.0);
  }
  EXPECT_EQ(survivor.data<float>()[2], 2.0f);
}

// What a listener hears, in order: the number of a parameter and its gradient.
struct Heard : GradientListener {
  std::size_t begun = 0;
  std::vector<std::pair<std::size_t, double>> ready;
  std::function<void()> at_ready = [] {};
  void Begin(std::span<const Var> parameters) override { begun += parameters.size(); }
  void Ready(std::size_t i, const Gradient& gradient) override {
    at_ready();
    ready.emplace_back(i, gradient.Value().item());
  }
};

TEST_F(Tape, AListenerHearsOfEachGradientOnceAndBeforeEarlierLayersAreDone) {
  const Var first = Vector({2}), twice = Vector({3}), last = Vector({5}), unused = Vector({7});
  bool walked = false;  // through what comes before `first` is used
  const Var x = External(context_, {.inputs = {first},
                                    .outputs = {context_.From({1}, std::vector<double>{2.0})},
                                    .backward = [&](std::span<const Tensor> d) {
                                      walked = true;
                                      return std::vector<Tensor>{d[0]};
                                    }})[0];
  const Var y = last * (twice * (twice * x));  // 90
  Heard heard;
  std::vector<bool> before;
  heard.at_ready = [&] { before.push_back(!walked); };
  const std::vector<Var> parameters = {first, twice, last, unused};
  const auto d = Gradients(y, parameters, &heard);
  EXPECT_EQ(heard.begun, 4u);
  EXPECT_EQ(heard.ready,
            (std::vector<std::pair<std::size_t, double>>{{2, 18}, {1, 60}, {0, 45}, {3, 0}}));
  EXPECT_EQ(before, (std::vector<bool>{true, true, false, false}));
  for (const auto& [i, value] : heard.ready) EXPECT_EQ(d[i].Value().item(), value);
}

constexpr std::size_t kMega = std::size_t{1} << 20;

TEST(AddressArena, TakesTheSmallestRangeThatFits) {
  AddressArena arena;
  std::byte* a = arena.Allocate(4 * kMega);
  std::byte* b = arena.Allocate(kMega);
  std::byte* c = arena.Allocate(2 * kMega);
  std::byte* d = arena.Allocate(kMega);
  arena.Free(a, 4 * kMega);
  arena.Free(c, 2 * kMega);
  EXPECT_EQ(arena.Allocate(kMega), c);
  EXPECT_EQ(arena.Allocate(3 * kMega), a);
  EXPECT_EQ(arena.growths(), 4u);
  EXPECT_EQ(arena.held(), 8 * kMega);
  arena.Free(b, kMega);
  arena.Free(d, kMega);
}

TEST(AddressArena, FreeNeighboursJoinWhateverTheOrder) {
  const std::vector<std::vector<int>> orders = {{0, 1, 2}, {2, 1, 0}, {0, 2, 1}, {1, 0, 2}};
  for (const auto& order : orders) {
    AddressArena arena;
    std::byte* blocks[3];
    for (std::byte*& block : blocks) block = arena.Allocate(kMega);
    for (const int i : order) arena.Free(blocks[i], kMega);
    EXPECT_EQ(arena.Allocate(3 * kMega), blocks[0]);
    EXPECT_EQ(arena.held(), 3 * kMega);
  }
}

TEST(AddressArena, GrowsByWhatIsMissingBehindAFreeEnd) {
  AddressArena arena;
  std::byte* a = arena.Allocate(kMega);
  std::byte* b = arena.Allocate(kMega);
  arena.Free(b, kMega);
  EXPECT_EQ(arena.Allocate(5 * kMega), b);
  EXPECT_EQ(arena.held(), 6 * kMega);
  arena.Free(a, kMega);
}

TEST(AddressArena, WithoutMemoryItIsAsBefore) {
  AddressArena arena;
  std::byte* const first = arena.Allocate(1 << 20);
  const std::size_t held = arena.held();
  EXPECT_THROW(arena.Allocate(std::size_t{1} << 60), std::bad_alloc);
  EXPECT_EQ(arena.held(), held);
  arena.Free(first, 1 << 20);
  EXPECT_EQ(arena.Allocate(1 << 20), first);
}

TEST(AddressArena, TrimmedMemoryIsThereAgain) {
  AddressArena arena;
  std::byte* a = arena.Allocate(8 * kMega);
  std::memset(a, 7, 8 * kMega);
  arena.Free(a, 8 * kMega);
  arena.Trim();
  EXPECT_EQ(arena.Allocate(8 * kMega), a);
  std::memset(a, 9, 8 * kMega);
  EXPECT_EQ(a[8 * kMega - 1], std::byte{9});
}

// Blocks of any size never overlap, are aligned, and rounds that repeat need no more memory.
TEST(AddressArena, RepeatedRoundsHoldNoMore) {
  struct Block {
    std::byte* data;
    std::size_t bytes;
    unsigned char mark;
  };
  AddressArena arena;
  std::size_t held = 0;
  for (int round = 0; round < 6; ++round) {
    Rng rng(11);
    std::vector<Block> live;
    const auto give = [&](std::size_t i) {
      const Block b = live[i];
      EXPECT_EQ(b.data[0], std::byte{b.mark});
      EXPECT_EQ(b.data[b.bytes - 1], std::byte{b.mark});
      arena.Free(b.data, b.bytes);
      live.erase(live.begin() + static_cast<std::ptrdiff_t>(i));
    };
    for (int i = 0; i < 400; ++i) {
      if (!live.empty() && rng.Below(5) < 2) give(rng.Below(live.size()));
      const std::size_t bytes = 1 + rng.Below(rng.Below(4) == 0 ? 3 * kMega : 3000);
      const auto mark = static_cast<unsigned char>(i);
      live.push_back({arena.Allocate(bytes), bytes, mark});
      EXPECT_EQ(reinterpret_cast<std::uintptr_t>(live.back().data) % kAlignment, 0u);
      std::memset(live.back().data, mark, bytes);
    }
    while (!live.empty()) give(0);
    if (round == 1) held = arena.held();
    EXPECT_TRUE(round < 2 || arena.held() == held) << round;
  }
}

}  // namespace tilegrad::nn::tape_test
