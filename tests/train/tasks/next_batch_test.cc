// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/next_batch.h"

#include <gtest/gtest.h>

#include <atomic>
#include <numeric>
#include <vector>

#include "support/expect.h"

namespace tilegrad::train::next_batch_test {

using Batch = std::vector<std::int64_t>;

// Batches of a few numbers that follow from their place; notes which were begun.
struct Maker {
  BatchWork<Batch> operator()(const BatchIndex& of) const {
    begun->push_back(of);
    const auto batch = std::make_shared<Batch>(5);
    return {batch->size(),
            [batch, of](std::size_t i, std::size_t) {
              (*batch)[i] = 100 * of.step + 10 * of.portion.index + static_cast<std::int64_t>(i);
            },
            [batch] { return Result<Batch>(*batch); }};
  }
  std::vector<BatchIndex>* begun;
};

Batch Want(std::int64_t first) {
  Batch batch(5);
  std::iota(batch.begin(), batch.end(), first);
  return batch;
}

TEST(NextBatch, IsTheSameForAnyNumberOfWorkers) {
  for (const int count : {1, 2, 16}) {
    const Workers workers(count);
    const nn::Context context(workers);
    NextBatch<Batch> batches(context);
    std::vector<BatchIndex> begun;
    for (std::int64_t step = 0; step < 30; ++step) {
      UpdateIndex at{step};
      if (step < 29) at.next = BatchIndex{step + 1};
      EXPECT_EQ(*Ok(batches.Take(at, Maker{&begun})), Want(100 * step));
    }
    EXPECT_EQ(begun.size(), 30u);  // each once, and none beyond the end
  }
}

TEST(NextBatch, FollowsPortionsAndStartsAnewAfterAJump) {
  const Workers workers(2);
  const nn::Context context(workers);
  NextBatch<Batch> batches(context);
  std::vector<BatchIndex> begun;
  const auto take = [&](std::int64_t step, std::int64_t portion, const BatchIndex& next) {
    UpdateIndex at{step};
    at.portion = {portion, 2};
    at.next = next;
    return *Ok(batches.Take(at, Maker{&begun}));
  };
  EXPECT_EQ(take(0, 0, {0, {1, 2}}), Want(0));
  EXPECT_EQ(take(0, 1, {1, {0, 2}}), Want(10));
  batches.Settle();
  EXPECT_EQ(take(7, 1, {8, {0, 2}}), Want(710));  // not what was expected
  EXPECT_EQ(take(8, 0, {8, {1, 2}}), Want(800));
  const std::vector<BatchIndex> want = {{0, {0, 2}}, {0, {1, 2}}, {1, {0, 2}},
                                        {7, {1, 2}}, {8, {0, 2}}, {8, {1, 2}}};
  EXPECT_EQ(begun, want);
}

TEST(NextBatch, TellsWhyThereIsNone) {
  const Workers workers(2);
  const nn::Context context(workers);
  NextBatch<Batch> batches(context);
  UpdateIndex at{0};
  at.next = BatchIndex{1};
  const auto make = [](const BatchIndex& of) {
    return BatchWork<Batch>{1, [](std::size_t, std::size_t) {},
                            [of]() -> Result<Batch> {
                              if (of.step == 0) return Batch();
                              return InvalidArgument("step {}", of.step);
                            }};
  };
  EXPECT_TRUE(batches.Take(at, make).ok());
  at = {1};
  ExpectMessage(batches.Take(at, make).status(), "step 1");
}

// Lanes make batches side by side, each with scratch of its own, and nothing beforehand.
TEST(NextBatch, ALaneMakesItsOwn) {
  const Workers workers(5);
  nn::Context context(workers);
  context.MakeLanes(2);
  NextBatch<Batch> batches(context);
  std::vector<std::atomic<int>> in_lane(SideLoop::LanesOf(workers));
  std::atomic<int> begun = 0, overlaps = 0;
  const auto make = [&](const BatchIndex& of) {
    ++begun;
    const auto batch = std::make_shared<Batch>(40);
    return BatchWork<Batch>{batch->size(),
                            [&, batch, of](std::size_t i, std::size_t lane) {
                              overlaps += in_lane[lane]++ > 0;
                              (*batch)[i] = of.portion.index;
                              --in_lane[lane];
                            },
                            [batch] { return Result<Batch>(*batch); }};
  };
  context.ForEachLane([&](std::size_t i) {
    UpdateIndex at{3};
    at.portion = {static_cast<std::int64_t>(i), 2};
    at.next = BatchIndex{4, at.portion};
    EXPECT_EQ(*Ok(batches.Take(at, make)), Batch(40, at.portion.index));
  });
  EXPECT_EQ(begun, 2);
  EXPECT_EQ(overlaps, 0);
}

}  // namespace tilegrad::train::next_batch_test
