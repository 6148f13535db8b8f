// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/gemm.h"

#include <gtest/gtest.h>

#include <string>

#include "nn/kernels/gemm_ref.h"
#include "nn/kernels/kernel_test_util.h"

namespace tilegrad::nn::gemm_test {

struct GemmCase {
  std::size_t m, n, k;
  bool transpose_a = false, transpose_b = false, bias = false, accumulate = false;
  std::size_t slack = 0;  // added to every leading dimension
};

std::string Describe(const GemmCase& c) {
  return std::to_string(c.m) + "x" + std::to_string(c.n) + "x" + std::to_string(c.k) +
         (c.transpose_a ? " A^T" : "") + (c.transpose_b ? " B^T" : "") + (c.bias ? " bias" : "") +
         (c.accumulate ? " accumulate" : "") + " slack " + std::to_string(c.slack);
}

// The operands of a case in storage of type T, dimensioned with exactly the elements the contract
// allows to be touched, so that a sanitizer sees any other.
template <class T>
struct Operands {
  std::vector<T> a, b, bias, c;

  GemmProblem<T> Problem(const GemmCase& g) {
    GemmProblem<T> p;
    p.m = g.m;
    p.n = g.n;
    p.k = g.k;
    p.transpose_a = g.transpose_a;
    p.transpose_b = g.transpose_b;
    p.accumulate = g.accumulate;
    p.a = a.data();
    p.lda = (g.transpose_a ? g.m : g.k) + g.slack;
    p.b = b.data();
    p.ldb = (g.transpose_b ? g.k : g.n) + g.slack;
    p.c = c.data();
    p.ldc = g.n + g.slack;
    p.bias = g.bias ? bias.data() : nullptr;
    return p;
  }
};

std::size_t Extent(std::size_t rows, std::size_t columns, std::size_t slack) {
  return rows * columns == 0 ? 0 : (rows - 1) * (columns + slack) + columns;
}

Operands<float> RandomOperands(const GemmCase& g, std::uint64_t seed) {
  Rng rng(seed);
  const auto matrix = [&](std::size_t rows, std::size_t columns, bool transposed) {
    if (transposed) std::swap(rows, columns);
    return RandomFloats(rng, Extent(rows, columns, g.slack));
  };
  return {matrix(g.m, g.k, g.transpose_a), matrix(g.k, g.n, g.transpose_b), RandomFloats(rng, g.n),
          matrix(g.m, g.n, false)};
}

Operands<double> Map(const Operands<float>& o,
                     std::vector<double> (*f)(const std::vector<float>&)) {
  return {f(o.a), f(o.b), f(o.bias), f(o.c)};
}

std::vector<float> RunGemm(const GemmCase& g, Operands<float> o, int workers) {
  const Workers pool(workers);
  KernelScratch scratch;
  Gemm(o.Problem(g), {pool, scratch});
  return o.c;
}

void CheckAgainstReference(const GemmCase& g, std::uint64_t seed) {
  SCOPED_TRACE(Describe(g));
  const Operands<float> operands = RandomOperands(g, seed);
  Operands<double> want = Map(operands, AsDoubles), magnitude = Map(operands, Magnitudes);
  GemmRef(want.Problem(g));
  GemmRef(magnitude.Problem(g));
  // Between the rows of C lie floats that are not ours: their magnitude is 0, so that they must be
  // bit-equal to before.
  const std::size_t ldc = g.n + g.slack;
  for (std::size_t i = 0; i < magnitude.c.size(); ++i) {
    if (i % ldc >= g.n) magnitude.c[i] = 0;
  }
  // k products, k - 1 additions, bias, old C, and the additions of depth blocks into C.
  ExpectWithinRounding(RunGemm(g, operands, 1), want.c, magnitude.c, g.k + g.k / 64 + 4);
}

TEST(Gemm, AgreesWithReferenceOnRandomProblems) {
  for (const std::string target : EveryTarget()) {
    Rng rng(7);
    for (std::uint64_t i = 0; i < 60; ++i) {
      const GemmCase g{.m = 1 + rng.Below(i < 40 ? 40 : 300),
                       .n = 1 + rng.Below(i < 40 ? 70 : 300),
                       .k = 1 + rng.Below(i < 40 ? 50 : 700),
                       .transpose_a = rng.Below(2) == 1,
                       .transpose_b = rng.Below(2) == 1,
                       .bias = rng.Below(2) == 1,
                       .accumulate = rng.Below(2) == 1,
                       .slack = rng.Below(3) * rng.Below(9)};
      CheckAgainstReference(g, i);
      if (HasFatalFailure()) return;
    }
  }
}

TEST(Gemm, AgreesWithReferenceOnSmallestExtents) {
  for (const std::string target : EveryTarget()) {
    for (std::size_t m : {1, 2, 7}) {
      for (std::size_t n : {1, 3, 17}) {
        for (std::size_t k : {1, 2, 5}) {
          for (int options = 0; options < 4; ++options) {
            CheckAgainstReference({.m = m,
                                   .n = n,
                                   .k = k,
                                   .transpose_a = (options & 1) != 0,
                                   .transpose_b = (options & 2) != 0},
                                  m + n + k);
            if (HasFatalFailure()) return;
          }
        }
      }
    }
  }
}

// Several blocks of B, each packed by the tiles of the block before: fewer and more tiles than rows
// to pack, columns with and without a tail, several blocks of columns, several groups of rows.
TEST(Gemm, AgreesWithReferenceWhilePackingAhead) {
  for (const std::string target : EveryTarget()) {
    for (std::size_t m : {1, 5, 64, 300, 301}) {
      for (std::size_t n : {1, 16, 131, 530}) {
        CheckAgainstReference({.m = m, .n = n, .k = 521, .bias = true, .slack = 3}, m + n);
        if (HasFatalFailure()) return;
      }
    }
  }
}

TEST(Gemm, EmptySumIsBiasPlusOldC) {
  const GemmCase g{.m = 2, .n = 3, .k = 0, .bias = true, .accumulate = true};
  Operands<float> o{{}, {}, {1, 2, 3}, {10, 20, 30, 40, 50, 60}};
  EXPECT_EQ(RunGemm(g, o, 1), (std::vector<float>{11, 22, 33, 41, 52, 63}));
  GemmCase overwrite = g;
  overwrite.bias = overwrite.accumulate = false;
  EXPECT_EQ(RunGemm(overwrite, o, 1), std::vector<float>(6, 0.0f));
}

TEST(Gemm, EmptyResultTouchesNothing) {
  for (const GemmCase& g : {GemmCase{.m = 0, .n = 3, .k = 2}, GemmCase{.m = 3, .n = 0, .k = 2}}) {
    Operands<float> o = RandomOperands(g, 1);
    o.c = {5};
    EXPECT_EQ(RunGemm(g, o, 2), std::vector<float>{5});
  }
}

TEST(Gemm, BitsDoNotDependOnWorkers) {
  for (const GemmCase& g :
       {GemmCase{.m = 70, .n = 530, .k = 700, .transpose_b = true},
        GemmCase{.m = 70, .n = 530, .k = 700},
        GemmCase{.m = 600, .n = 70, .k = 90, .transpose_a = true, .accumulate = true},
        GemmCase{.m = 9000, .n = 20, .k = 600}}) {
    SCOPED_TRACE(Describe(g));
    const Operands<float> o = RandomOperands(g, 3);
    const std::vector<float> one = RunGemm(g, o, 1);
    EXPECT_EQ(RunGemm(g, o, 2), one);
    EXPECT_EQ(RunGemm(g, o, 7), one);
  }
}

}  // namespace tilegrad::nn::gemm_test
