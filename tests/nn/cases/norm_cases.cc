// SPDX-License-Identifier: Apache-2.0
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

}  // namespace

void AddNormCases(CaseList& list) {
  for (const Shape& shape : {Shape{5 + list.Extent(9), 2}, Shape{2, 2, 2, 1 + list.Extent(9)}}) {
    for (const bool relu : {false, true}) AddBatchNorm(list, shape, relu);
  }
}

}  // namespace tilegrad::nn
