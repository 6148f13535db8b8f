// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "nn/cases/cases.h"

namespace tilegrad::nn {
namespace {

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

void AddSampleNorms(CaseList& list) {
  const std::int64_t n = list.Extent(3), h = list.Extent(3), w = 1 + list.Extent(9);
  const InputSpec x = {{n, 4, h, w}, -0.7, 1, true}, gamma = {{4}, 0.5, 1}, beta = {{4}};
  const NormOptions options{.epsilon = 1e-2};
  const int roundings = 32 + 8 * static_cast<int>(h * w);
  list.Add({"instance norm",
            [=](const Inputs& v) { return InstanceNorm(v[0], v[1], v[2], options); },
            {x, gamma, beta},
            roundings});
  list.Add({"group norm",
            [=](const Inputs& v) { return GroupNorm(v[0], 2, v[1], v[2], options); },
            {x, gamma, beta},
            roundings});
  list.Add({"layer norm of images",
            [=](const Inputs& v) { return LayerNorm(v[0], v[1], v[2], options); },
            {x, {{4, h, w}, 0.5, 1}, {{4, h, w}}},
            2 * roundings});
  list.Add({"layer norm",
            [=](const Inputs& v) { return LayerNorm(v[0], v[1], v[2], options); },
            {{{n, 11}, -0.7, 1, true}, {{11}, 0.5, 1}, {{11}}},
            roundings});
}

void AddSpectralNorm(CaseList& list) {
  list.Add({"spectral norm",
            [](const Inputs& v) {
              // Any u and v will do: the derivative is exact for each.
              Context& context = v[0].context();
              const std::vector<double> u = {0.6, 0.0, 0.8};
              const std::int64_t rest = v[0].shape().elements() / 3;
              return Square(SpectralNorm(
                  v[0], {context.From({3}, u),
                         context.Full({rest}, 1 / std::sqrt(static_cast<double>(rest)))}));
            },
            {{{3, 2, list.Extent(3), list.Extent(5)}, 0.2, 1}},
            96});
}

}  // namespace

void AddNormCases(CaseList& list) {
  for (const Shape& shape : {Shape{5 + list.Extent(9), 2}, Shape{2, 2, 2, 1 + list.Extent(9)}}) {
    for (const bool relu : {false, true}) AddBatchNorm(list, shape, relu);
  }
  for (int trial = 0; trial < 3; ++trial) AddSampleNorms(list);
  AddSpectralNorm(list);
}

}  // namespace tilegrad::nn
