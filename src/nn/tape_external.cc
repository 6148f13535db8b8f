// SPDX-License-Identifier: Apache-2.0
// Operations whose value and adjoint are computed outside of the library.
#include <utility>
#include <vector>

#include "base/error.h"
#include "nn/tape.h"
#include "nn/tape_node.h"

namespace tilegrad::nn {

namespace {

// The adjoints of an external operation's inputs. Where a graph of them is wanted they are marked,
// so that asking for a second derivative is an error rather than a silent zero.
Vars ExternalBackward(const ExternalOp& op, Context& context, std::span<const Var> d_outputs) {
  std::vector<Tensor> tensors;
  for (const Var& d : d_outputs) tensors.push_back(d.value());
  std::vector<Tensor> d_inputs = op.backward(tensors);
  if (d_inputs.size() != op.inputs.size()) {
    context.Fail(InternalError("{}: backward returned {} adjoints for {} inputs", op.name,
                               d_inputs.size(), op.inputs.size()));
    return {};
  }
  std::vector<Var> parents = op.inputs;
  for (const Var& d : d_outputs) {
    if (d.valid()) parents.push_back(d);
  }
  const auto refuse = [&context, name = op.name](const Adjoint&) {
    context.Fail(InvalidArgument("{} has a first derivative only", name));
    return Vars();
  };
  Vars result;
  for (std::size_t i = 0; i < d_inputs.size(); ++i) {
    if (!d_inputs[i].empty() && !(d_inputs[i].shape() == op.inputs[i].shape())) {
      context.Fail(InternalError("{}: adjoint {} has shape {}, its input {}", op.name, i,
                                 d_inputs[i].shape().ToString(), op.inputs[i].shape().ToString()));
      return {};
    }
    result.push_back(d_inputs[i].empty() ? Var() : Record({op.name}, d_inputs[i], parents, refuse));
  }
  return result;
}

}  // namespace

std::vector<Var> External(Context& context, ExternalOp op) {
  std::vector<Var> result;
  for (const Var& input : op.inputs) {
    if (!input.valid()) return std::vector<Var>(op.outputs.size(), Var(context, Tensor()));
  }
  std::shared_ptr<Node> node;
  if (WantsNode(context, op.inputs)) {
    node = MakeNode(context, {op.name}, op.inputs);
    node->slots = static_cast<int>(op.outputs.size());
  }
  int slot = 0;
  for (Tensor& output : op.outputs) result.emplace_back(context, output, node, slot++);
  op.outputs.clear();  // the graph need not hold them
  if (node) {
    node->rule = [&context, op = std::move(op)](const Adjoint& adjoint) {
      return ExternalBackward(op, context, adjoint.d_outputs());
    };
  }
  return result;
}

}  // namespace tilegrad::nn
