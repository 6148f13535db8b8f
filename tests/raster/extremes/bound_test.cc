// SPDX-License-Identifier: Apache-2.0
// The promise of max_alpha_error, through the Renderer: no background pixel of any scene is farther
// from equation 6 over all faces than E, nor than Frame::alpha_error_bound says, rounding aside
// (docs/numerics.md, "Rounding"); and in whatever order the faces stand.
#include <gtest/gtest.h>

#include <cstdio>
#include <string>
#include <vector>

#include "base/simd_target.h"
#include "raster/extremes/bound_check.h"
#include "support/expect.h"

namespace tilegrad::test::bound_test {

void CheckBound(std::uint64_t first, std::size_t count) {
  const Workers workers, one(1);
  std::vector<Renderer> renderers;
  for (int w = 0; w < workers.count(); ++w) renderers.push_back(RendererOn(one));
  std::vector<BoundSummary> scenes(count);
  workers.For(count, [&](std::size_t n, std::size_t w) {
    scenes[n] = CheckBoundScene({first + n}, &renderers[w]);
  });
  BoundSummary all;
  for (std::size_t n = 0; n < count; ++n) {
    const BoundSummary& s = scenes[n];
    EXPECT_TRUE(s.Kept()) << "scene " << first + n << ": " << s.failed;
    all.Add(s);
  }
  std::printf(
      "bound on alpha, %s: %zu scenes in two orders, %zu faces, %zu pixels (%zu between 0 and 1); "
      "largest violation of E %.3g, of the reported budget %.3g, by permuting %.3g; "
      "largest error %.3g E\n",
      ActiveTarget().c_str(), all.scenes, all.faces, all.pixels, all.between, all.over_budget,
      all.over_spent, all.order, all.share);
  EXPECT_GT(all.pixels, count);
  EXPECT_GT(all.between, count / 3);
}

TEST(AlphaBound, HoldsInEveryScene) {
  std::uint64_t first = 0;
  for (const std::string target : EveryTarget()) {
    CheckBound(first, 60);
    first += 60;
  }
}

TEST(AlphaBoundLong, TwentyThousandScenes) {
  CheckBound(1000000, 20000);
  for (const std::string target : EveryTarget()) {
    CheckBound(2000000, 1000);
  }
}

}  // namespace tilegrad::test::bound_test
