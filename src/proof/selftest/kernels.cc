// SPDX-License-Identifier: Apache-2.0
// Products of matrices and convolutions against scalar loops in double.
#include "nn/kernels/conv2d/winograd.h"
#include "nn/kernels/gemm.h"
#include "nn/kernels/gemm_ref.h"
#include "nn/kernels/kernel_trial.h"
#include "proof/selftest/check.h"
#include "scene/shapes.h"
#include "train/metrics/metrics.h"

namespace tilegrad::selftest {
namespace {

// Extents with tails, blocks of depth, and operands as in layers and their gradients.
struct ProductCase {
  std::size_t m, n, k;
  bool transpose_a, transpose_b;
};
constexpr ProductCase kProducts[] = {{37, 53, 129, false, true},
                                     {37, 53, 129, false, false},
                                     {70, 33, 64, true, false},
                                     {1, 130, 300, false, true}};

template <class T>
nn::GemmProblem<T> ProblemOf(const ProductCase& c, const std::vector<T>& a, const std::vector<T>& b,
                             std::vector<T>* out) {
  nn::GemmProblem<T> p;
  p.m = c.m;
  p.n = c.n;
  p.k = c.k;
  p.a = a.data();
  p.lda = c.transpose_a ? c.m : c.k;
  p.transpose_a = c.transpose_a;
  p.b = b.data();
  p.ldb = c.transpose_b ? c.k : c.n;
  p.transpose_b = c.transpose_b;
  p.c = out->data();
  p.ldc = c.n;
  return p;
}

std::vector<double> ProductRef(const ProductCase& c, const std::vector<double>& a,
                               const std::vector<double>& b) {
  std::vector<double> out(c.m * c.n);
  nn::GemmRef(ProblemOf(c, a, b, &out));
  return out;
}

// |error| <= gamma_n sum |a_i b_i| with n roundings: k products, their additions, and those of
// blocks of depth.
Status CheckProduct(const CheckContext& context, const ProductCase& c, Gauge* gauge) {
  Rng rng(6, 24);
  const auto a = nn::RandomFloats(rng, c.m * c.k), b = nn::RandomFloats(rng, c.k * c.n);
  std::vector<float> got(c.m * c.n);
  nn::KernelScratch scratch;
  nn::Gemm(ProblemOf(c, a, b, &got), {context.workers, scratch});
  context.Take("product", got);
  const auto want = ProductRef(c, nn::AsDoubles(a), nn::AsDoubles(b));
  const auto size = ProductRef(c, nn::Magnitudes(a), nn::Magnitudes(b));
  const double gamma = nn::Gamma(c.k + c.k / 64 + 4);
  return gauge->ExpectEach("product", got, want, [&](std::size_t i) { return gamma * size[i]; });
}

Result<Finding> Products(const CheckContext& context) {
  Gauge gauge;
  for (const ProductCase& c : kProducts) {
    TILEGRAD_TRY(CheckProduct(context, c, &gauge)
                     .Within(fmt::format("[{}, {}] x [{}, {}]", c.m, c.k, c.k, c.n)));
  }
  return gauge.Found();
}

std::string Describe(const nn::Conv2dShape& s) {
  return fmt::format("{} x {} kernel, stride {}, {} to {} channels", s.kernel_height,
                     s.kernel_width, s.stride, s.in_channels, s.out_channels);
}

void Take(const CheckContext& context, nn::Conv2dResults* r) {
  context.Take("y", r->y);
  context.Take("d_x", r->d_x);
  context.Take("d_weight", r->d_weight);
}

// Padded and strided; few channels, tails, and a kernel as large as the image.
constexpr nn::Conv2dShape kDirect[] = {{2, 3, 9, 11, 5, 3, 3, 1, 1},
                                       {2, 5, 12, 10, 7, 4, 4, 2, 1},
                                       {3, 17, 6, 6, 9, 1, 1, 1, 0},
                                       {5, 20, 4, 4, 6, 4, 4, 1, 0}};

// As products, with the roundings of each result.
Status CheckDirect(const CheckContext& context, const nn::Conv2dShape& s, Gauge* gauge) {
  const nn::Conv2dOperands o = nn::RandomConv2dOperands(s, 7);
  nn::Conv2dResults got = nn::RunConv2d(s, o, {.workers = context.workers.count()});
  Take(context, &got);
  const nn::Conv2dTruth want = nn::RunConv2dReference(s, o, nn::AsDoubles);
  const nn::Conv2dTruth size = nn::RunConv2dReference(s, o, nn::Magnitudes);
  const nn::Conv2dRoundings most(s);
  const auto check = [&](const char* what, const std::vector<float>& g,
                         const std::vector<double>& w, const std::vector<double>& magnitude,
                         std::size_t n) {
    return gauge->ExpectEach(what, g, w,
                             [&](std::size_t i) { return nn::Gamma(n) * magnitude[i]; });
  };
  TILEGRAD_TRY(check("y", got.y, want.y, size.y, most.y));
  TILEGRAD_TRY(check("d_x", got.d_x, want.d_x, size.d_x, most.d_x));
  return check("d_weight", got.d_weight, want.d_weight, size.d_weight, most.d_weight);
}

Result<Finding> DirectConvolutions(const CheckContext& context) {
  Gauge gauge;
  for (const nn::Conv2dShape& s : kDirect) {
    TILEGRAD_TRY(CheckDirect(context, s, &gauge).Within(Describe(s)));
  }
  return gauge.Found();
}

constexpr nn::Conv2dShape kWinograd[] = {{2, 20, 9, 10, 16, 3, 3, 1, 1},
                                         {2, 16, 12, 14, 20, 4, 4, 2, 1},
                                         {1, 16, 12, 9, 18, 5, 5, 2, 2}};

// The transforms cost some accuracy: root mean square errors are 0.6 to 2.4 times those of the
// direct kernels (winograd.h), whose bound the previous check tests. Allows 4 times; a wrong term
// gives tens of thousands.
Status CheckWinograd(const CheckContext& context, const nn::Conv2dShape& s, Gauge* gauge) {
  if (!nn::WinogradFits(s)) return InternalError("is not taken by Winograd's algorithm");
  const nn::Conv2dOperands o = nn::RandomConv2dOperands(s, 8);
  const int workers = context.workers.count();
  const nn::Conv2dResults direct = nn::RunConv2d(s, o, {.workers = workers});
  nn::Conv2dResults fast = nn::RunConv2d(s, o, {.workers = workers, .winograd = true});
  Take(context, &fast);
  const nn::Conv2dTruth want = nn::RunConv2dReference(s, o, nn::AsDoubles);
  const auto check = [&](const std::string& what, const std::vector<float>& got,
                         const std::vector<float>& slow, const std::vector<double>& truth) {
    const double off[] = {nn::RootMeanSquareError(got, truth)}, none[] = {0.0};
    return gauge->Expect("root mean square error of " + what, off, none,
                         4 * nn::RootMeanSquareError(slow, truth));
  };
  TILEGRAD_TRY(check("y", fast.y, direct.y, want.y));
  TILEGRAD_TRY(check("d_x", fast.d_x, direct.d_x, want.d_x));
  return check("d_weight", fast.d_weight, direct.d_weight, want.d_weight);
}

Result<Finding> WinogradConvolutions(const CheckContext& context) {
  Gauge gauge;
  for (const nn::Conv2dShape& s : kWinograd) {
    TILEGRAD_TRY(CheckWinograd(context, s, &gauge).Within(Describe(s)));
  }
  return gauge.Found();
}

// Scores of meshes with known scores.

constexpr int kVoxels = 32;

Status ExpectScore(const CheckContext& context, const std::string& what, double got, double want) {
  std::vector<double> score = {got};
  context.Take(what, score);
  if (score[0] == want) return {};
  return InternalError("{} is {}, expected {}", what, score[0], want);
}

// The faces of the rod lie in the middle of voxels: 15 of 32 wide, it crosses 16 x 16 in each
// layer, and the cube fills all.
Result<Finding> Iou(const CheckContext& context) {
  TILEGRAD_ASSIGN(const auto torus, train::Voxelize(Torus(1, 0.4f, 24, 12), kVoxels));
  TILEGRAD_ASSIGN(const auto cube, train::Voxelize(Box({0, 0, 0}, {1, 1, 1}), kVoxels));
  TILEGRAD_ASSIGN(const auto rod,
                  train::Voxelize(Box({0, 0, 0}, {1, 0.46875f, 0.46875f}), kVoxels));
  TILEGRAD_TRY(ExpectScore(context, "IoU of a torus and itself", train::VoxelIou(torus, torus), 1));
  TILEGRAD_TRY(ExpectScore(context, "IoU of a rod and a cube", train::VoxelIou(rod, cube), 0.25));
  return Finding{"1 of a mesh and itself, 1/4 of a rod and a cube"};
}

// Two squares of points, one 1/8 above the other: the nearest point is the one above.
Result<Finding> Surfaces(const CheckContext& context) {
  TILEGRAD_ASSIGN(const auto points, train::SampleSurface(Torus(1, 0.4f, 24, 12), 2000, 17));
  const auto same = train::CompareSurfaces(points, points, 0.02);
  TILEGRAD_TRY(ExpectScore(context, "F-score of a mesh and itself", same.f_score, 1));
  TILEGRAD_TRY(ExpectScore(context, "Chamfer distance of a mesh and itself", same.chamfer, 0));
  std::vector<glm::vec3> low, high;
  for (int i = 0; i < 100; ++i) {
    low.emplace_back(i / 10, i % 10, 0);
    high.emplace_back(i / 10, i % 10, 0.125f);
  }
  const auto far = train::CompareSurfaces(low, high, 0.1),
             near = train::CompareSurfaces(low, high, 0.2);
  TILEGRAD_TRY(ExpectScore(context, "Chamfer distance of two squares", far.chamfer, 0.125));
  TILEGRAD_TRY(ExpectScore(context, "F-score of two squares, too far", far.f_score, 0));
  TILEGRAD_TRY(ExpectScore(context, "F-score of two squares, near", near.f_score, 1));
  return Finding{"F-score 1 and Chamfer 0 of a mesh and itself"};
}

}  // namespace

std::vector<Check> KernelChecks() {
  return {
      OnEveryTarget({"networks: products of matrices", Products}),
      OnEveryTarget({"networks: convolutions and their gradients", DirectConvolutions}),
      OnEveryTarget({"networks: the same by Winograd's algorithm", WinogradConvolutions}),
  };
}

std::vector<Check> MetricChecks() {
  return {{"metrics: 3D IoU", Iou}, {"metrics: F-score and Chamfer distance", Surfaces}};
}

}  // namespace tilegrad::selftest
