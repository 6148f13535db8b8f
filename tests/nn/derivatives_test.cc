// SPDX-License-Identifier: Apache-2.0
// First and second derivatives of every operation of cases/: in double against differences, and in
// float on every SIMD target against double.
#include <gtest/gtest.h>

#include "nn/gradient_check.h"
#include "support/expect.h"

namespace tilegrad::nn::derivatives_test {

void Examine(const OpCase& c) {
  SCOPED_TRACE(c.name);
  const Workers workers(2);
  Context exact(workers, DType::kF64);
  Rng rng(20191002);
  const Leaves leaves = RandomLeaves(exact, c, rng);
  ASSERT_TRUE(exact.status().ok()) << exact.status().message();
  const Derivatives want = Differentiate(c.function, leaves);
  ASSERT_TRUE(exact.status().ok()) << exact.status().message();
  ExpectSlopes(c.function, leaves, want);
  std::vector<double> condition;
  for (const Var* q : {&want.s, &want.first, &want.second}) {
    condition.push_back(Condition(*q, leaves));
  }
  for (const std::string target : EveryTarget()) {
    Context context(workers);
    ExpectFloatAgrees(c, want, condition, Differentiate(c.function, InFloat(context, leaves)));
    EXPECT_TRUE(context.status().ok()) << context.status().message();
  }
}

void ExamineAll(void (*add)(CaseList&)) {
  CaseList list(20191001);
  add(list);
  for (const OpCase& c : list.cases) Examine(c);
}

TEST(Derivatives, Pointwise) { ExamineAll(AddPointwiseCases); }
TEST(Derivatives, Reductions) { ExamineAll(AddReduceCases); }
TEST(Derivatives, Shapes) { ExamineAll(AddShapeCases); }
TEST(Derivatives, Products) { ExamineAll(AddProductCases); }
TEST(Derivatives, Images) { ExamineAll(AddImageCases); }
TEST(Derivatives, Softmax) { ExamineAll(AddSoftmaxCases); }
TEST(Derivatives, Normalisation) { ExamineAll(AddNormCases); }

}  // namespace tilegrad::nn::derivatives_test
