// SPDX-License-Identifier: Apache-2.0
// The graph behind a tape's Vars: the recorded operations. For tape*.cc only.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "nn/tape.h"

namespace tilegrad::nn {

// One operation of the graph. Holds values only through its rule (and `saved`), so a value that no
// rule needs is freed as soon as the caller drops its Var.
struct Node : std::enable_shared_from_this<Node> {
  Node() = default;
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;
  ~Node();

  struct Edge {
    std::shared_ptr<Node> node;  // null: no gradient flows there
    int slot = 0;
  };
  OpInfo info;
  std::uint64_t order = 0;      // greater than that of every node it depends on
  InlineVector<Edge, 3> edges;  // one per input; none: a leaf
  int slots = 1;                // outputs
  Rule rule;
  Tensor saved;  // the output, if the rule needs it
  bool released = false;
  std::shared_ptr<Node> next_doomed;  // list of nodes to destroy, without recursion
};

// For an operation on `inputs`, without a rule yet.
std::shared_ptr<Node> MakeNode(Context& context, const OpInfo& info, std::span<const Var> inputs);

// Whether an operation on `inputs` must be recorded, since a gradient of one of them may be
// requested.
bool WantsNode(const Context& context, std::span<const Var> inputs);

}  // namespace tilegrad::nn
