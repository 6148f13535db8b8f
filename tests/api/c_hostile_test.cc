// SPDX-License-Identifier: Apache-2.0
// The C interface under random calls (c_caller.h). What must not happen shows under valgrind or the
// address sanitizer, too.
//
// A failure names its seed. More of them: TILEGRAD_SECONDS, TILEGRAD_SEED, and the test
// api_c_hostile_long.
#include <gtest/gtest.h>
#include <malloc.h>

#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <string>
#include <thread>
#include <vector>

#include "api/c_caller.h"

namespace tilegrad::c_hostile_test {

// Two that work, and numbers that are none.
Caller MakeCaller(std::uint64_t seed) { return {Dice(seed), {1, 2, 0, -1, 5000}}; }

std::uint64_t FromEnvironment(const char* name, std::uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

void CallAtRandom(std::uint64_t seed) {
  constexpr int kCalls = 4000;
  Caller caller = MakeCaller(seed);
  for (int i = 0; i < kCalls; ++i) {
    SCOPED_TRACE("seed " + std::to_string(seed) + ", call " + std::to_string(i));
    caller.Call();
    ASSERT_FALSE(testing::Test::HasFailure());
  }
  // Not all is refused.
  EXPECT_GT(caller.good_renders(), kCalls / 10);
  EXPECT_GT(caller.good_backwards(), kCalls / 40);
}

// TILEGRAD_SECONDS: how long; TILEGRAD_SEED: the first.
void CallFor(std::uint64_t seconds) {
  mallopt(M_PERTURB, kPerturb);
  const auto end = std::chrono::steady_clock::now() +
                   std::chrono::seconds(FromEnvironment("TILEGRAD_SECONDS", seconds));
  std::uint64_t seed = FromEnvironment("TILEGRAD_SEED", 1);
  do {
    std::cout << "seed " << seed << std::endl;
    CallAtRandom(seed++);
  } while (std::chrono::steady_clock::now() < end && !testing::Test::HasFailure());
}

TEST(HostileC, CallsAreOkOrErrorsWithAMessage) { CallFor(0); }
TEST(HostileC, LongCallsAreToo) { CallFor(120); }

TEST(HostileC, CallersOnSeveralThreadsDoNotMeet) {
  std::vector<std::thread> threads;
  for (std::uint64_t seed = 11; seed < 14; ++seed) {
    threads.emplace_back([seed] {
      Caller caller = MakeCaller(seed);
      for (int i = 0; i < 500; ++i) caller.Call();
    });
  }
  for (std::thread& thread : threads) thread.join();
}

}  // namespace tilegrad::c_hostile_test
