// SPDX-License-Identifier: Apache-2.0
// sgemm against the FMA peak of one core, OpenBLAS and oneDNN, in one process, taking turns.
// Operands lie in memory as tensors do (large ones on huge pages).
#include <vector>

#include "base/aligned.h"
#include "base/rng.h"
#include "nn/kernels/gemm.h"
#include "peers.h"
#include "turns.h"

namespace tilegrad::nn::bench {
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

struct Setup {
  explicit Setup(const benchmark::State& state)
      : m(Arg(state, 0)), n(Arg(state, 1)), k(Arg(state, 2)), matrices(m, n, k) {
    p.m = m;
    p.n = n;
    p.k = k;
    p.transpose_a = state.range(3) == kTN;
    p.transpose_b = state.range(3) == kNT;
    p.a = matrices.a.data();
    p.lda = p.transpose_a ? m : k;
    p.b = matrices.b.data();
    p.ldb = p.transpose_b ? k : n;
    p.c = matrices.c.data();
    p.ldc = n;
  }
  static std::size_t Arg(const benchmark::State& state, std::size_t i) {
    return static_cast<std::size_t>(state.range(i));
  }
  std::size_t m, n, k;
  Matrices matrices;
  GemmProblem<float> p;
};

void BM_Gemm(benchmark::State& state) {
  const Setup setup(state);
  const Workers workers(1);
  KernelScratch scratch;
  std::vector<Contender> contenders{{"ours", [&] { Gemm(setup.p, {workers, scratch}); }}};
  for (const GemmPeer& peer : {OpenBlasPeer(), OneDnnPeer()}) {
    if (peer.run != nullptr) contenders.push_back({peer.name, [&, peer] { peer.run(setup.p); }});
  }
  MeasureRates(state, 2.0 * static_cast<double>(setup.m * setup.n * setup.k), contenders);
}

void BM_GemmTwoWorkers(benchmark::State& state) {
  const Setup setup(state);
  MeasureSpeedup(state, [&](const KernelContext& context) { Gemm(setup.p, context); });
}

void Shapes(benchmark::internal::Benchmark* b) {
  b->ArgNames({"m", "n", "k", "layout"})->Unit(benchmark::kMillisecond)->MinTime(4);
  for (const auto& s : std::vector<std::vector<std::int64_t>>{{1024, 1024, 1024, kNN},
                                                              {64, 1024, 16384, kNN},
                                                              {64, 1024, 16384, kNT},
                                                              {64, 1024, 1024, kNT},
                                                              {128, 4096, 1600, kNN},
                                                              {256, 4096, 3200, kNN},
                                                              {64, 16384, 1024, kNN},
                                                              {16384, 1024, 64, kNN},
                                                              {1024, 16384, 64, kTN}}) {
    b->Args(s);
  }
}

BENCHMARK(BM_Gemm)->Apply(Shapes);
BENCHMARK(BM_GemmTwoWorkers)->Apply(Shapes)->MinTime(0.5)->UseRealTime();

}  // namespace
}  // namespace tilegrad::nn::bench
