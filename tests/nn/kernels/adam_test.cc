// SPDX-License-Identifier: Apache-2.0
// A step of Adam against the reference in double, on every target.
#include "nn/kernels/adam.h"

#include "nn/kernels/adam_ref.h"
#include "nn/kernels/kernel_test_util.h"

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
    for (const auto& target : RunnableTargets()) {
      const OnTarget on(target);
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

}  // namespace tilegrad::nn::adam_test
