// SPDX-License-Identifier: Apache-2.0
#include "fma_peak.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "../bench/nn/fma_peak.cc"
#include <benchmark/benchmark.h>
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <cstdint>
#include <numeric>
#include <utility>
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

// One addition that the compiler neither drops nor joins with the next.
HWY_INLINE void CountUp(std::uint64_t* count) {
  ++*count;
  asm volatile("" : "+r"(*count));
}

// Two additions for each FMA: six instructions a cycle where two of them are FMAs.
template <std::size_t i>
HWY_INLINE void AddAndCount(Vec factor, Vec* sum, std::uint64_t* count) {
  sum[i] = hn::MulAdd(factor, factor, sum[i]);
  CountUp(&count[i % 6]);
  CountUp(&count[(i + 3) % 6]);
}

template <std::size_t... i>
HWY_INLINE void FullCoreStep(std::index_sequence<i...>, Vec factor, Vec* sum,
                             std::uint64_t* count) {
  (AddAndCount<i>(factor, sum, count), ...);
}

double RunFullCoreTarget() {
  constexpr std::size_t kSteps = 10000, kSums = 12;
  float factor = 1e-3f;
  benchmark::DoNotOptimize(factor);
  const Vec factors = hn::Set(Tag(), factor);
  Vec sum[kSums];
  std::uint64_t count[6] = {};
  for (std::size_t i = 0; i < kSums; ++i) sum[i] = hn::Set(Tag(), static_cast<float>(i));
  for (std::size_t step = 0; step < kSteps; ++step) {
    FullCoreStep(std::make_index_sequence<kSums>(), factors, sum, count);
  }
  Vec total = sum[0];
  for (std::size_t i = 1; i < kSums; ++i) total = hn::Add(total, sum[i]);
  float used = hn::GetLane(total);
  benchmark::DoNotOptimize(used);
  return 2.0 * kSteps * kSums * kLanes;
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tilegrad::nn {
HWY_EXPORT(RunFmaPeakTarget);
HWY_EXPORT(RunFullCoreTarget);
double RunFmaPeak() { return HWY_DYNAMIC_DISPATCH(RunFmaPeakTarget)(); }
double RunFullCore() { return HWY_DYNAMIC_DISPATCH(RunFullCoreTarget)(); }
}  // namespace tilegrad::nn
#endif
