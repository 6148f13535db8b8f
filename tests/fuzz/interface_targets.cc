// SPDX-License-Identifier: Apache-2.0
// The C interface: an input is a program of calls, two bytes a choice (api/c_caller.h).
#include "api/c_caller.h"
#include "fuzz/numbers.h"
#include "fuzz/target.h"

namespace tilegrad::fuzz::interface_targets {

void Calls(Input input) {
  const bool failed_before = testing::UnitTest::GetInstance()->ad_hoc_test_result().Failed();
  Caller caller(Dice(input), {1, 2});
  for (int i = 0; i < 24 && !caller.used_up(); ++i) caller.Call();
  const bool failed = testing::UnitTest::GetInstance()->ad_hoc_test_result().Failed();
  Require(failed_before || !failed, "each call is OK or an error with a message");
}

const Registration kTarget({"c_interface", Calls, RandomSeeds<6, 3000>, nullptr, 2});

}  // namespace tilegrad::fuzz::interface_targets
