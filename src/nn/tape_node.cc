// SPDX-License-Identifier: Apache-2.0
#include "nn/tape_node.h"

#include <algorithm>
#include <utility>

namespace tilegrad::nn {

namespace {

// Releases what `node` depends on; prepends nodes without another owner to the list `doomed`.
void Dismantle(Node& node, std::shared_ptr<Node>& doomed) {
  node.rule = nullptr;  // its Vars are of the nodes that the edges still hold
  for (Node::Edge& edge : node.edges) {
    const std::shared_ptr<Node> below = std::move(edge.node);
    if (below.use_count() != 1) continue;
    below->next_doomed = std::move(doomed);
    doomed = below;
  }
}

}  // namespace

// A loop, since recursive destruction of a long chain would overflow the stack after some hundred
// thousand nodes.
Node::~Node() {
  std::shared_ptr<Node> doomed;
  Dismantle(*this, doomed);
  while (doomed) {
    const std::shared_ptr<Node> node = std::move(doomed);
    doomed = std::move(node->next_doomed);
    Dismantle(*node, doomed);
  }
}

std::shared_ptr<Node> MakeNode(Context& context, const OpInfo& info, std::span<const Var> inputs) {
  auto node = std::allocate_shared<Node>(context.allocator<Node>());
  node->info = info;
  node->order = context.NextOrder();
  for (const Var& input : inputs) node->edges.push_back({input.node(), input.slot()});
  return node;
}

bool WantsNode(const Context& context, std::span<const Var> inputs) {
  return context.recording() &&
         std::any_of(inputs.begin(), inputs.end(), [](const Var& v) { return v.requires_grad(); });
}

}  // namespace tilegrad::nn
