// SPDX-License-Identifier: Apache-2.0
// Steps of an adversarial game and of a U-Net in float: same bits for any number of workers, no
// tensor from the heap after the first steps.
#include <gtest/gtest.h>

#include <cmath>

#include "nn/game.h"

namespace tilegrad::nn::networks_training_test {

TEST(NetworksTraining, SameBitsForAnyNumberOfWorkersOver100Steps) {
  Bytes want;
  for (const int count : {1, 2, 7}) {
    const Workers workers(count);
    Game game(workers);
    for (std::uint64_t step = 0; step < 100; ++step) game.Step(step);
    if (want.empty()) want = game.Encoded();
    EXPECT_EQ(game.Encoded(), want) << count;
  }
}

TEST(NetworksTraining, MemoryIsReused) {
  const Workers workers(2);
  Game game(workers);
  game.Step(0);
  game.Step(1);
  const MemoryStats warm = game.memory();
  for (std::uint64_t step = 2; step < 8; ++step) EXPECT_TRUE(std::isfinite(game.Step(step)));
  EXPECT_EQ(game.memory().misses, warm.misses);
  EXPECT_EQ(game.memory().peak_bytes, warm.peak_bytes);
}

}  // namespace tilegrad::nn::networks_training_test
