// SPDX-License-Identifier: Apache-2.0
#include "fma_peak.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "../bench/nn/fma_peak.cc"
#include <benchmark/benchmark.h>
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <numeric>
#include <vector>

#include "nn/kernels/micro_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// A factor that is always the same register.
struct Constant {
  Vec value;
  HWY_INLINE Vec At(std::size_t) const { return value; }
  HWY_INLINE void Advance() {}
};

double RunFmaPeakTarget() {
  constexpr std::size_t kSteps = 40000;
  constexpr std::size_t kRows = 6;  // 12 sums: more than latency x units of any core we know
  // Start values and factor must be unknown to the compiler, and all sums differ, or it would
  // simplify products and merge sums.
  std::vector<float> sums(kRows * kTileColumns);
  std::iota(sums.begin(), sums.end(), 1.0f);
  float factor = 1e-3f;
  benchmark::DoNotOptimize(sums.data());
  benchmark::DoNotOptimize(factor);
  benchmark::ClobberMemory();
  Tile<kRows> tile;
  for (std::size_t i = 0; i < kRows * kTileVectors; ++i) {
    tile.sum[i / kTileVectors][i % kTileVectors] = hn::LoadU(Tag(), &sums[i * kLanes]);
  }
  Constant rows{hn::Set(Tag(), factor)}, columns{hn::Set(Tag(), factor)};
  tile.Multiply(rows, columns, kSteps);
  tile.Store(
      {.c = sums.data(), .ldc = kTileColumns, .offset = {0, kLanes}, .count = {kLanes, kLanes}});
  benchmark::DoNotOptimize(sums.data());
  benchmark::ClobberMemory();
  return 2.0 * kSteps * kRows * kTileColumns;
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tilegrad::nn {
HWY_EXPORT(RunFmaPeakTarget);
double RunFmaPeak() { return HWY_DYNAMIC_DISPATCH(RunFmaPeakTarget)(); }
}  // namespace tilegrad::nn
#endif
