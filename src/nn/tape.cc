// SPDX-License-Identifier: Apache-2.0
#include "nn/tape.h"

#include <algorithm>
#include <limits>

#include "nn/ops.h"
#include "nn/tape_node.h"

namespace tilegrad::nn {

double Var::item() const {
  if (!valid() || value_.elements() != 1) return std::numeric_limits<double>::quiet_NaN();
  return WithFloatType(dtype(), [&]<class T>(T) { return static_cast<double>(*value_.data<T>()); });
}

Var Constant(Context& context, Tensor value) { return Var(context, std::move(value)); }

Var Constant(Context& context, double value) { return Var(context, context.Full({}, value)); }

Var Parameter(Context& context, Tensor value) {
  return Var(context, std::move(value), MakeNode(context, {"parameter"}, {}));
}

// Of portions [first, first + count).
Var Gradient::SumOf(std::int64_t first, std::int64_t count) const {
  if (count > 1) return Add(SumOf(first, count / 2), SumOf(first + count / 2, count / 2));
  const std::int64_t steps = first_.shape()[0] / portions_, begin = first * steps;
  return Matmul(Slice(first_, 0, begin, begin + steps), Slice(second_, 0, begin, begin + steps),
                {.transpose_a = true});
}

Var Gradient::Value() const {
  if (!is_product()) return first_;
  if (portions_ == 1) return Matmul(first_, second_, {.transpose_a = true});
  return Scale(SumOf(0, portions_), 1 / static_cast<double>(portions_));
}

Var Adjoint::Product(std::size_t input, const Var& a, const Var& b) const {
  if (left_ == nullptr) return Matmul(a, b, {.transpose_a = true});
  *left_ = {.input = input, .product = Gradient(a, b)};
  return {};
}

Var Adjoint::Part(std::size_t input, const AdjointPart& part) const {
  if (left_ == nullptr) return Pad(part.value, part.axis, part.before, part.after);
  *left_ = {.input = input, .part = part};
  return {};
}

Var Detach(const Var& x) { return x.has_context() ? Var(x.context(), x.value()) : x; }

Var Record(const OpInfo& info, Tensor value, std::span<const Var> inputs, Rule rule) {
  Context& context = inputs[0].context();
  if (!WantsNode(context, inputs)) return Var(context, std::move(value));
  auto node = MakeNode(context, info, inputs);
  node->rule = std::move(rule);
  if (info.save_output) node->saved = value;
  return Var(context, std::move(value), std::move(node));
}

Var Record(const OpInfo& info, Tensor value, std::initializer_list<Var> inputs, Rule rule) {
  return Record(info, std::move(value), std::span<const Var>(inputs.begin(), inputs.size()),
                std::move(rule));
}

Var Invalid(std::initializer_list<const Var*> operands) {
  for (const Var* v : operands) {
    if (v->has_context()) return Var(v->context(), Tensor());
  }
  return {};
}

Var Fail(const Var& operand, Status status) {
  operand.context().Fail(std::move(status));
  return Invalid({&operand});
}

bool Usable(const char* op, std::initializer_list<const Var*> operands) {
  const Var& first = **operands.begin();
  for (const Var* v : operands) {
    if (v->has_context() && first.has_context() && &v->context() != &first.context()) {
      // Memory, errors and recording belong to a context: with two, each would have half.
      for (Context* of : {&first.context(), &v->context()})
        of->Fail(InvalidArgument("{}: operands are of two contexts; copy one's tensor", op));
      return false;
    }
    if (!v->valid()) return false;
    const bool is_float = v->dtype() == DType::kF32 || v->dtype() == DType::kF64;
    if (!is_float || v->dtype() != first.dtype()) {
      v->context().Fail(InvalidArgument("{}: operands must be all F32 or all F64, got {} and {}",
                                        op, NameOf(first.dtype()), NameOf(v->dtype())));
      return false;
    }
  }
  return true;
}

bool IsPossibleResult(const char* op, const Var& operand, const Shape& result) {
  if (result.IsPossible()) return true;
  operand.context().Fail(InvalidArgument("{}: {} would give {}, which is too large for a tensor",
                                         op, operand.shape(), result));
  return false;
}

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

// Operations whose value and adjoint are computed outside of the library.

// The adjoints of an external operation's inputs. If a graph of them is recorded, they are
// marked, so that a second derivative is an error rather than a silent zero.
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
                                 d_inputs[i].shape(), op.inputs[i].shape()));
      return {};
    }
    result.push_back(d_inputs[i].empty() ? Var() : Record({op.name}, d_inputs[i], parents, refuse));
  }
  return result;
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
