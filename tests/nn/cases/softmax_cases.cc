// SPDX-License-Identifier: Apache-2.0
#include "nn/cases/cases.h"

namespace tilegrad::nn {

void AddSoftmaxCases(CaseList& list) {
  const Shape shape = {2, list.Extent(3), 1 + list.Extent(9)};
  for (int axis = 0; axis < 3; ++axis) {
    const InputSpec x = {shape, -3, 3, /*separated=*/true};
    list.Add({"softmax", [=](const Inputs& v) { return Softmax(v[0], axis); }, {x}, 64});
    list.Add({"log softmax", [=](const Inputs& v) { return LogSoftmax(v[0], axis); }, {x}, 64});
  }
  const InputSpec logits = {{4, 5}, -3, 3, true};
  list.Add({"cross-entropy",
            [](const Inputs& v) {
              const std::vector<std::int32_t> labels = {4, 0, 2, 2};
              return CrossEntropy(v[0], v[0].context().Indices(labels));
            },
            {logits},
            96});
}

}  // namespace tilegrad::nn
