// SPDX-License-Identifier: Apache-2.0
// A step of Adam against the reference in double, on every target.
#include "nn/kernels/adam.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "nn/kernels/adam_ref.h"
#include "nn/kernels/kernel_test_util.h"
#include "nn/kernels/product_adam.h"

namespace tilegrad::nn::adam_test {

TEST(Adam, EqualsReference) {
  const Workers workers(2);
  Rng rng(8);
  const AdamCoefficients coefficients{
      .epsilon = 1e-3, .step = 0.05, .inverse_root = 1.5, .keep = 0.99};
  for (const std::size_t n : {1, 3, 8, 29, 70001}) {
    const auto p0 = RandomFloats(rng, n), g = RandomFloats(rng, n), m0 = RandomFloats(rng, n);
    std::vector<float> v0 = RandomFloats(rng, n);
    for (float& v : v0) v = std::abs(v);
    auto pd = AsDoubles(p0), gd = AsDoubles(g), md = AsDoubles(m0), vd = AsDoubles(v0);
    AdamStepRef(AdamProblem<double>{n, pd.data(), gd.data(), md.data(), vd.data(), coefficients}, 0,
                n);
    for (const std::string target : EveryTarget()) {
      auto p = p0, m = m0, v = v0;
      AdamStep(AdamProblem<float>{n, p.data(), g.data(), m.data(), v.data(), coefficients},
               workers);
      for (std::size_t i = 0; i < n; ++i) {
        // Numbers of size 1; coefficients rounded to float, three to nine roundings on top.
        ASSERT_NEAR(m[i], md[i], Gamma(5)) << i;
        ASSERT_NEAR(v[i], vd[i], Gamma(6) * (vd[i] + 1e-3)) << i;
        // The step is 0.05 m / (1.5 sqrt v + 1e-3), of which m may have cancelled.
        const double denominator = std::sqrt(vd[i]) * 1.5 + 1e-3;
        ASSERT_NEAR(p[i], pd[i], Gamma(4) + Gamma(12) * 0.05 / denominator) << i;
      }
    }
  }
}

// Adam along a product that is never stored: the bits of the product and of the step by themselves,
// on every target and for any number of workers.
struct Case {
  std::size_t m, n, k;
  bool transpose_a = true, transpose_b = false;
  std::size_t portions = 1;
};

struct State {
  std::vector<float> p, m, v;
  bool operator==(const State&) const = default;
};

// A step from `state` along op(a) op(b).
class Step {
 public:
  explicit Step(const Case& c) : case_(c) {
    Rng rng(c.m + c.n + c.k);
    a_ = RandomFloats(rng, c.m * c.k);
    b_ = RandomFloats(rng, c.k * c.n);
    start_ = {RandomFloats(rng, c.m * c.n), RandomFloats(rng, c.m * c.n),
              RandomFloats(rng, c.m * c.n)};
    for (float& v : start_.v) v = std::abs(v);
  }

  State Apart() const {
    const Workers workers(1);
    KernelScratch scratch;
    State state = start_;
    std::vector<float> gradient = SumOf(0, case_.portions, {workers, scratch});
    for (float& g : gradient) g *= 1 / static_cast<float>(case_.portions);
    AdamProblem<float> adam = Problem(state);
    adam.gradient = gradient.data();
    AdamStep(adam, workers);
    return state;
  }
  State Together(int count) const {
    const Workers workers(count);
    KernelScratch scratch;
    State state = start_;
    State other = start_;
    const ProductAdamProblem both[] = {{Product(), Problem(other), case_.portions},
                                       {Product(), Problem(state), case_.portions}};
    ProductAdamSteps(both, {workers, scratch});
    EXPECT_EQ(other.p, state.p);
    return state;
  }

 private:
  // Of portions [first, first + count), a power of two.
  std::vector<float> SumOf(std::size_t first, std::size_t count, const KernelContext& on) const {
    if (count > 1) {
      std::vector<float> left = SumOf(first, count / 2, on);
      const std::vector<float> right = SumOf(first + count / 2, count / 2, on);
      std::ranges::transform(left, right, left.begin(), std::plus());
      return left;
    }
    std::vector<float> sum(start_.p.size());
    GemmProblem<float> product = Product();
    product.k /= case_.portions;
    const std::size_t begin = first * product.k;
    product.a += case_.transpose_a ? begin * product.lda : begin;
    product.b += case_.transpose_b ? begin : begin * product.ldb;
    product.c = sum.data();
    product.ldc = case_.n;
    Gemm(product, on);
    return sum;
  }
  GemmProblem<float> Product() const {
    GemmProblem<float> product;
    product.m = case_.m;
    product.n = case_.n;
    product.k = case_.k;
    product.a = a_.data();
    product.lda = case_.transpose_a ? case_.m : case_.k;
    product.b = b_.data();
    product.ldb = case_.transpose_b ? case_.k : case_.n;
    product.transpose_a = case_.transpose_a;
    product.transpose_b = case_.transpose_b;
    return product;
  }
  static AdamProblem<float> Problem(State& state) {
    return {.n = state.p.size(),
            .parameter = state.p.data(),
            .m = state.m.data(),
            .v = state.v.data(),
            .coefficients = {.epsilon = 1e-3, .step = 0.05, .inverse_root = 1.5, .keep = 0.99}};
  }

  Case case_;
  std::vector<float> a_, b_;
  State start_;
};

// Tails of tiles, lines and groups; several groups, items of rows and items of columns.
TEST(ProductAdam, BitsOfProductAndStep) {
  for (const std::string target : EveryTarget()) {
    for (const Case& c :
         {Case{1, 1, 1}, Case{5, 3, 2}, Case{6, 16, 8}, Case{7, 33, 64}, Case{64, 100, 256},
          Case{13, 1, 9}, Case{40, 50, 3, false, true}, Case{300, 41, 20}, Case{30, 2070, 5}}) {
      const Step step(c);
      EXPECT_EQ(step.Together(1), step.Apart()) << c.m << " " << c.n << " " << c.k;
    }
  }
}

TEST(ProductAdam, BitsOfMeansOverPortions) {
  for (const std::string target : EveryTarget()) {
    for (const Case& c : {Case{1, 1, 2, true, false, 2}, Case{5, 3, 4, true, false, 4},
                          Case{7, 33, 64, true, false, 64}, Case{64, 100, 256, true, false, 16},
                          Case{13, 70, 24, true, false, 8}, Case{40, 50, 6, false, true, 2},
                          Case{64, 64, 256, true, false, 256}, Case{30, 2070, 4, true, false, 4}}) {
      const Step step(c);
      EXPECT_EQ(step.Together(1), step.Apart()) << c.m << " " << c.n << " " << c.k;
    }
  }
}

TEST(ProductAdam, BitsDoNotDependOnWorkers) {
  for (const Case& c :
       {Case{700, 1100, 40}, Case{100, 300, 9}, Case{700, 1100, 40, true, false, 8}}) {
    const Step step(c);
    const State apart = step.Apart();
    for (const int count : {1, 2, 7, 16}) EXPECT_EQ(step.Together(count), apart) << count;
  }
}

TEST(ProductAdam, OfNoMatrixDoesNothing) {
  const Workers workers(2);
  KernelScratch scratch;
  ProductAdamSteps({}, {workers, scratch});
  EXPECT_EQ(scratch.bytes(), 0u);
}

}  // namespace tilegrad::nn::adam_test
