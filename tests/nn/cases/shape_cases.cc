// SPDX-License-Identifier: Apache-2.0
#include "nn/cases/cases.h"

namespace tilegrad::nn {

void AddShapeCases(CaseList& list) {
  const Shape shape = {2, 3, 4 + list.Extent(9)};
  const auto add = [&](const std::string& name, const std::function<Var(const Var&)>& f) {
    list.Add({name, [f](const Inputs& v) { return Square(f(v[0])); }, {{shape}}, 32});
  };
  add("reshape", [](const Var& x) { return Reshape(x, {3, -1}); });
  add("broadcast", [s = shape](const Var& x) { return BroadcastTo(x, {3, s[0], s[1], s[2]}); });
  add("permute", [](const Var& x) { return Permute(x, {2, 0, 1}); });
  add("concat", [](const Var& x) { return Concat({x, Scale(x, 2.0), x}, 1); });
  for (int axis = 0; axis < 3; ++axis) {
    add("slice", [=](const Var& x) { return Slice(x, axis, 1, 2); });
    add("pad", [=](const Var& x) { return Pad(x, axis, 2, 1); });
    add("gather", [=](const Var& x) {
      const std::vector<std::int32_t> indices = {1, 0, 1, 1, 0};
      return Gather(x, axis, x.context().Indices(indices));
    });
  }
  const std::vector<std::int32_t> picks = {1, 0, 1, 3, 3, 3};
  const auto pick = [picks](const Var& x) { return x.context().Indices(picks); };
  list.Add({"take along",
            [pick](const Inputs& v) {
              return Square(TakeAlong(v[0], pick(v[0]).Reshaped({2, 3})));
            },
            {{{2, 4}}},
            32});
  list.Add({"place along",
            [pick](const Inputs& v) {
              return Square(PlaceAlong(v[0], pick(v[0]).Reshaped({2, 3}), 5));
            },
            {{{2, 3}}},
            32});
  list.Add({"broadcast 1",
            [](const Inputs& v) {
              return Square(BroadcastTo(v[0], {2, 3, 4}));
            },
            {{{3, 1}}},
            32});
  list.Add({"transpose", [](const Inputs& v) { return Square(Transpose(v[0])); }, {{{2, 5}}}});
  list.Add({"scatter add",
            [](const Inputs& v) {
              const std::vector<std::int32_t> indices = {2, 0, 2, 2, 1};
              return Square(ScatterAdd(v[0], 0, v[0].context().Indices(indices), 4));
            },
            {{{5, list.Extent(9)}}},
            32});
}

}  // namespace tilegrad::nn
