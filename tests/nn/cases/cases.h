// SPDX-License-Identifier: Apache-2.0
// The list of operations whose derivatives are tested: one line each, over random shapes.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "base/rng.h"
#include "nn/nn.h"

namespace tilegrad::nn {

using Inputs = std::vector<Var>;
using Function = std::function<Var(const Inputs&)>;  // of any shape, in any context

// Random numbers in [low, high); `separated`: evenly spaced in random order, so that small steps
// change neither which one is largest nor the side of a kink at the middle.
struct InputSpec {
  Shape shape;
  double low = -1, high = 1;
  bool separated = false;
};

struct OpCase {
  std::string name;
  Function function;
  std::vector<InputSpec> inputs;
  // The most roundings that a number passes through on its way to an output, about: the lengths of
  // sums, and a few for each operation.
  int roundings = 16;
};

class CaseList {
 public:
  explicit CaseList(std::uint64_t seed) : rng(seed) {}
  // Random extent in [1, limit].
  std::int64_t Extent(std::uint64_t limit = 4) {
    return 1 + static_cast<std::int64_t>(rng.Below(limit));
  }
  void Add(OpCase c) { cases.push_back(std::move(c)); }

  Rng rng;
  std::vector<OpCase> cases;
};

void AddPointwiseCases(CaseList& list);
void AddReduceCases(CaseList& list);
void AddShapeCases(CaseList& list);
void AddProductCases(CaseList& list);
void AddNormCases(CaseList& list);
void AddImageCases(CaseList& list);
void AddSoftmaxCases(CaseList& list);

}  // namespace tilegrad::nn
