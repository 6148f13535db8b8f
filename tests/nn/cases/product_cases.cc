// SPDX-License-Identifier: Apache-2.0
#include "nn/cases/cases.h"

namespace tilegrad::nn {
namespace {

void AddConvolutions(CaseList& list, const Shape& x, const Shape& w, const ConvOptions& options) {
  const ImageSize size{x[2], x[3]}, kernel{w[2], w[3]};
  const auto extent = [&](std::int64_t from, std::int64_t window) {
    return (from + 2 * options.padding - window) / options.stride + 1;
  };
  const Shape y = {x[0], w[0], extent(x[2], w[2]), extent(x[3], w[3])};
  const auto terms =
      std::max(w.Product(1, 4), std::max(y[0] * y[2] * y[3], w[0] * w.Product(2, 4)));
  const int roundings = 16 + 3 * static_cast<int>(terms);
  const std::string what = " " + x.ToString() + w.ToString() + " stride " +
                           std::to_string(options.stride) + " padding " +
                           std::to_string(options.padding);
  list.Add({"conv2d" + what,
            [=](const Inputs& v) { return Conv2d(v[0], v[1], v[2], options); },
            {{x}, {w}, {{w[0]}}},
            roundings});
  list.Add({"conv2d input gradient" + what,
            [=](const Inputs& v) { return Conv2dInputGrad(v[0], v[1], size, options); },
            {{y}, {w}},
            roundings});
  list.Add({"conv2d weight gradient" + what,
            [=](const Inputs& v) { return Conv2dWeightGrad(v[0], v[1], kernel, options); },
            {{x}, {y}},
            roundings});
}

void AddRandomConvolutions(CaseList& list) {
  const std::int64_t n = list.Extent(), in = list.Extent(), out = list.Extent();
  const Shape w = {out, in, list.Extent(), list.Extent()};
  const ConvOptions options{static_cast<int>(list.Extent(3)), static_cast<int>(list.rng.Below(3))};
  AddConvolutions(list, {n, in, w[2] + list.Extent(), w[3] + list.Extent(9)}, w, options);
}

// Channels enough for kernels/conv2d/winograd.h.
void AddWinogradConvolutions(CaseList& list) {
  AddConvolutions(list, {1, 16, 5, 6}, {16, 16, 3, 3}, {.stride = 1, .padding = 1});
  AddConvolutions(list, {1, 17, 7, 8}, {16, 17, 4, 4}, {.stride = 2, .padding = 1});
  AddConvolutions(list, {1, 16, 6, 7}, {18, 16, 5, 5}, {.stride = 2, .padding = 2});
}

const char* NameOf(PadMode mode) {
  const char* names[] = {"zero", "circular", "replicate"};
  return names[static_cast<int>(mode)];
}

void AddPaddedConvolution(CaseList& list, PadMode mode) {
  const ConvOptions options{static_cast<int>(list.Extent(2)), static_cast<int>(list.Extent(2)),
                            mode};
  const Shape x = {list.Extent(2), list.Extent(3), 3 + list.Extent(3), 3 + list.Extent(9)};
  const Shape w = {list.Extent(3), x[1], 3, 3};
  list.Add({std::string("conv2d padded ") + NameOf(mode),
            [=](const Inputs& v) { return Conv2d(v[0], v[1], v[2], options); },
            {{x}, {w}, {{w[0]}}},
            256});
}

struct ModeCase {
  const char* name;
  PadMode mode;
};

void AddPadding(CaseList& list) {
  const Shape shape = {list.Extent(2), list.Extent(3), 2 + list.Extent(2), 2 + list.Extent(9)};
  for (const auto& [name, mode] :
       {ModeCase{"zero", PadMode::kZero}, ModeCase{"circular", PadMode::kCircular},
        ModeCase{"replicate", PadMode::kReplicate}}) {
    list.Add({std::string("pad image ") + name,
              [how = mode](const Inputs& v) {
                return Square(PadImage(v[0], {2, 1, 0, 2}, how));
              },
              {{shape}},
              48});
    list.Add({std::string("pad axis 0 ") + name,
              [how = mode](const Inputs& v) { return Square(Pad(v[0], 0, 1, 2, how)); },
              {{{3, list.Extent(11)}}},
              48});
  }
}

void AddResizing(CaseList& list) {
  for (const auto& [name, mode] :
       {std::pair{"nearest", ResizeMode::kNearest}, std::pair{"bilinear", ResizeMode::kBilinear}}) {
    const Shape shape = {list.Extent(2), list.Extent(2), list.Extent(5), list.Extent(9)};
    const ImageSize size{list.Extent(7), list.Extent(12)};
    list.Add({std::string("resize ") + name,
              [how = mode, size](const Inputs& v) { return Square(Resize(v[0], size, how)); },
              {{shape}},
              64});
  }
}

void AddPooling(CaseList& list) {
  PoolOptions options{.kernel = static_cast<int>(list.Extent(3)),
                      .stride = static_cast<int>(list.Extent(3))};
  options.padding =
      static_cast<int>(list.rng.Below(static_cast<std::uint64_t>(options.kernel / 2 + 1)));
  const Shape shape = {list.Extent(2), list.Extent(2), 2 + list.Extent(4), 2 + list.Extent(9)};
  const InputSpec x = {shape, -0.7, 1, /*separated=*/true};
  const std::string what = " kernel " + std::to_string(options.kernel) + " stride " +
                           std::to_string(options.stride) + " padding " +
                           std::to_string(options.padding);
  list.Add({"average pooling" + what,
            [=](const Inputs& v) { return Square(AvgPool2d(v[0], options)); },
            {x},
            64});
  list.Add({"max pooling" + what,
            [=](const Inputs& v) { return Square(MaxPool2d(v[0], options)); },
            {x},
            64});
}

// beta lifts one channel clear of the kink of relu and sinks the other.
const InputSpec kBeta = {{2}, -12, 12, /*separated=*/true};

void AddBatchNorm(CaseList& list, const Shape& shape, bool relu) {
  const BatchNormOptions options{.epsilon = 1e-2, .relu = relu};
  const std::string what = shape.ToString() + (relu ? " relu" : "");
  const int roundings = 32 + 4 * static_cast<int>(shape.elements());
  list.Add({"batch norm " + what,
            [=](const Inputs& v) { return BatchNormTrain(v[0], v[1], v[2], options).y; },
            {{shape, -1, 1, true}, {{2}, 0.5, 1}, kBeta},
            roundings});
  list.Add({"batch norm eval " + what,
            [=](const Inputs& v) {
              const BatchStatistics statistics{v[0].context().Full({2}, 0.1),
                                               v[0].context().Full({2}, 0.7)};
              return BatchNormEval(v[0], v[1], v[2], statistics, options);
            },
            {{shape}, {{2}, 0.5, 1}, kBeta},
            roundings});
}

}  // namespace

void AddProductCases(CaseList& list) {
  for (const bool ta : {false, true}) {
    for (const bool tb : {false, true}) {
      const std::int64_t m = list.Extent(9), n = list.Extent(19), k = list.Extent(7);
      list.Add({"matmul",
                [=](const Inputs& v) {
                  return Matmul(v[0], v[1], {ta, tb});
                },
                {{ta ? Shape{k, m} : Shape{m, k}}, {tb ? Shape{n, k} : Shape{k, n}}},
                64});
    }
  }
  list.Add({"linear",
            [](const Inputs& v) { return Linear(v[0], v[1], v[2]); },
            {{{3, 4}}, {{9, 4}}, {{9}}},
            64});
  list.Add({"linear without bias",
            [](const Inputs& v) { return Linear(v[0], v[1], Var()); },
            {{{3, 4}}, {{5, 4}}},
            64});
  for (int trial = 0; trial < 8; ++trial) AddRandomConvolutions(list);
  AddWinogradConvolutions(list);
  for (const PadMode mode : {PadMode::kZero, PadMode::kCircular, PadMode::kReplicate}) {
    AddPaddedConvolution(list, mode);
  }
}

void AddImageCases(CaseList& list) {
  AddPadding(list);
  for (int trial = 0; trial < 4; ++trial) AddResizing(list);
  for (int trial = 0; trial < 4; ++trial) AddPooling(list);
}

void AddNormCases(CaseList& list) {
  for (const Shape& shape : {Shape{5 + list.Extent(9), 2}, Shape{2, 2, 2, 1 + list.Extent(9)}}) {
    for (const bool relu : {false, true}) AddBatchNorm(list, shape, relu);
  }
}

}  // namespace tilegrad::nn
