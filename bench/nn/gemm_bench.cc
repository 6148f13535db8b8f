// SPDX-License-Identifier: Apache-2.0
// sgemm against the FMA peak of one core and against OpenBLAS, in one process, taking turns.
// Columns: medians of CPU-time rates. peak: GFLOP/s of the core; ours, openblas: % of it.
#include <benchmark/benchmark.h>
#ifdef TILEGRAD_HAVE_OPENBLAS
#include <cblas.h>
#endif

#include <vector>

#include "base/aligned.h"
#include "base/rng.h"
#include "fma_peak.h"
#include "nn/kernels/gemm.h"

namespace tilegrad::nn {
namespace {

enum Layout { kNN, kNT, kTN };  // which of A, B is transposed

struct Matrices {
  Matrices(std::size_t m, std::size_t n, std::size_t k) : a(m * k), b(k * n), c(m * n) {
    Rng rng(1);
    for (float& v : a) v = static_cast<float>(rng.Uniform(-1, 1));
    for (float& v : b) v = static_cast<float>(rng.Uniform(-1, 1));
  }
  AlignedVector<float> a, b, c;
};

GemmProblem<float> ProblemOf(const benchmark::State& state, Matrices& x) {
  const auto arg = [&](int i) { return static_cast<std::size_t>(state.range(i)); };
  GemmProblem<float> p;
  p.m = arg(0), p.n = arg(1), p.k = arg(2);
  p.transpose_a = arg(3) == kTN, p.transpose_b = arg(3) == kNT;
  p.a = x.a.data(), p.lda = p.transpose_a ? p.m : p.k;
  p.b = x.b.data(), p.ldb = p.transpose_b ? p.k : p.n;
  p.c = x.c.data(), p.ldc = p.n;
  return p;
}

#ifdef TILEGRAD_HAVE_OPENBLAS
void RunOpenBlas(const GemmProblem<float>& p) {
  openblas_set_num_threads(1);
  const auto op = [](bool transposed) { return transposed ? CblasTrans : CblasNoTrans; };
  cblas_sgemm(CblasRowMajor, op(p.transpose_a), op(p.transpose_b), static_cast<int>(p.m),
              static_cast<int>(p.n), static_cast<int>(p.k), 1.0f, p.a, static_cast<int>(p.lda), p.b,
              static_cast<int>(p.ldb), 0.0f, p.c, static_cast<int>(p.ldc));
}
#endif

void BM_Gemm(benchmark::State& state) {
  Matrices matrices(static_cast<std::size_t>(state.range(0)),
                    static_cast<std::size_t>(state.range(1)),
                    static_cast<std::size_t>(state.range(2)));
  const GemmProblem<float> p = ProblemOf(state, matrices);
  const double flop = 2.0 * static_cast<double>(p.m * p.n) * static_cast<double>(p.k);
  const Workers workers(1);
  KernelScratch scratch;
  Samples peak, ours, openblas;
  Gemm(p, {workers, scratch});
  for (auto _ : state) {
    peak.Add(PeakRate());
    ours.Add(Rate(ThreadSeconds, flop, [&] { Gemm(p, {workers, scratch}); }));
#ifdef TILEGRAD_HAVE_OPENBLAS
    openblas.Add(Rate(ThreadSeconds, flop, [&] { RunOpenBlas(p); }));
#endif
  }
  state.counters["peak"] = peak.Median() * 1e-9;
  state.counters["ours"] = 100 * ours.Median() / peak.Median();
#ifdef TILEGRAD_HAVE_OPENBLAS
  state.counters["openblas"] = 100 * openblas.Median() / peak.Median();
#else
  state.SetLabel("OpenBLAS not found: no comparison");
#endif
}

// Wall time of one worker over that of two.
void BM_GemmTwoWorkers(benchmark::State& state) {
  Matrices matrices(static_cast<std::size_t>(state.range(0)),
                    static_cast<std::size_t>(state.range(1)),
                    static_cast<std::size_t>(state.range(2)));
  const GemmProblem<float> p = ProblemOf(state, matrices);
  const Workers one(1), two(2);
  KernelScratch scratch;
  Samples rate_one, rate_two;
  Gemm(p, {two, scratch});
  for (auto _ : state) {
    rate_one.Add(Rate(WallSeconds, 1, [&] { Gemm(p, {one, scratch}); }));
    rate_two.Add(Rate(WallSeconds, 1, [&] { Gemm(p, {two, scratch}); }));
  }
  state.counters["speedup"] = rate_two.Median() / rate_one.Median();
}

void Shapes(benchmark::internal::Benchmark* b) {
  b->ArgNames({"m", "n", "k", "layout"})->Unit(benchmark::kMillisecond)->MinTime(0.5);
  for (const auto& s : std::vector<std::vector<std::int64_t>>{{1024, 1024, 1024, kNN},
                                                              {64, 1024, 16384, kNN},
                                                              {64, 1024, 16384, kNT},
                                                              {64, 1024, 1024, kNT},
                                                              {128, 4096, 1600, kNN},
                                                              {256, 4096, 3200, kNN},
                                                              {64, 16384, 1024, kNN},
                                                              {64, 16384, 1024, kNT},
                                                              {16384, 1024, 64, kNN},
                                                              {16384, 1024, 64, kTN}}) {
    b->Args(s);
  }
}

BENCHMARK(BM_Gemm)->Apply(Shapes);
BENCHMARK(BM_GemmTwoWorkers)->Apply(Shapes)->UseRealTime();

}  // namespace
}  // namespace tilegrad::nn
