// SPDX-License-Identifier: Apache-2.0
#include "nn/cases/cases.h"

namespace tilegrad::nn {

void AddReduceCases(CaseList& list) {
  const Shape shape = {list.Extent(), list.Extent(), list.Extent(5), 1 + list.Extent(18)};
  const int roundings = 16 + static_cast<int>(shape.elements());
  const auto add = [&](const std::string& name, const std::function<Var(const Var&)>& f) {
    list.Add({name,
              [f](const Inputs& v) { return Square(f(v[0])); },
              {{shape, -0.7, 1, /*separated=*/true}},
              roundings});
  };
  add("sum", [](const Var& x) { return Sum(x); });
  add("mean", [](const Var& x) { return Mean(x); });
  for (const Keep keep : {Keep::kNo, Keep::kYes}) {
    add("sum 0", [=](const Var& x) { return Sum(x, {0}, keep); });
    add("sum 1 3", [=](const Var& x) { return Sum(x, {1, 3}, keep); });
    add("sum 0 2 3", [=](const Var& x) { return Sum(x, {0, 2, 3}, keep); });
    add("mean 2", [=](const Var& x) { return Mean(x, {2}, keep); });
    add("reduce max 1 2", [=](const Var& x) { return ReduceMax(x, {1, 2}, keep); });
    add("reduce min 3", [=](const Var& x) { return ReduceMin(x, {3}, keep); });
  }
  list.Add({"sum to",
            [](const Inputs& v) {
              return Square(SumTo(v[0], {3, 1, 2}));
            },
            {{{2, 3, 4, 2}}},
            32});
}

}  // namespace tilegrad::nn
