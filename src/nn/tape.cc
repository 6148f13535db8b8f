// SPDX-License-Identifier: Apache-2.0
#include "nn/tape.h"

#include <algorithm>
#include <limits>
#include <type_traits>
#include <unordered_map>
#include <utility>

#include "base/error.h"
#include "nn/ops/matmul.h"
#include "nn/ops/pointwise.h"

namespace tilegrad::nn {

// One operation of the graph. Holds values only through its rule (and `saved`), so a value that no
// rule needs is free as soon as the caller lets go of its Var.
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
  InlineVector<Edge, 3> edges;  // one for each input; none: a leaf
  int slots = 1;                // outputs
  Rule rule;
  Tensor saved;  // the output, where the rule wants it
  bool released = false;
  std::shared_ptr<Node> next_doomed;  // while a graph is taken apart
};

namespace {

// Lets go of what `node` depends on; what nobody else holds goes before `doomed`.
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

// In a loop: left to themselves the nodes of a long chain would end inside each other, on a stack
// that has room for some hundred thousand.
Node::~Node() {
  std::shared_ptr<Node> doomed;
  Dismantle(*this, doomed);
  while (doomed) {
    const std::shared_ptr<Node> node = std::move(doomed);
    doomed = std::move(node->next_doomed);
    Dismantle(*node, doomed);
  }
}

namespace {

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

// One walk backwards over the graph of `output`.
class Backward {
 public:
  // `leave_products`: those that are the whole gradient of an input are left to the caller.
  Backward(const Var& output, std::span<const Var> inputs, const GradOptions& options,
           bool leave_products)
      : context_(output.context()),
        output_(output),
        options_(options),
        leave_products_(leave_products),
        inputs_(inputs),
        order_(context_.allocator<Node*>()),
        visits_(context_.allocator<std::pair<Node* const, Visit>>()) {
    if (output.requires_grad()) Collect(output.node().get());
    for (const Var& input : inputs) MarkUseful(input.node().get());
    std::sort(order_.begin(), order_.end(),
              [](const Node* a, const Node* b) { return a->order < b->order; });
    for (Node* node : order_) {
      for (const auto& edge : node->edges) {
        if (edge.node && visits_[edge.node.get()].useful) visits_[node].useful = true;
      }
    }
  }

  void Run(const Var& d_output) {
    const RecordingScope recording(context_, options_.create_graph);
    if (output_.requires_grad()) Deposit(output_.node().get(), output_.slot(), d_output);
    for (auto it = order_.rbegin(); it != order_.rend() && context_.status().ok(); ++it) {
      if (visits_[*it].useful && !(*it)->edges.empty()) Step(**it);
    }
  }

  Gradient Result(const Var& input) {
    const auto it = visits_.find(input.node().get());
    if (it != visits_.end() && it->second.product.valid()) return it->second.product;
    if (it != visits_.end() && !it->second.d.empty()) {
      const Var& d = it->second.d[static_cast<std::size_t>(input.slot())];
      if (d.valid()) return Gradient(d);
    }
    Tensor zeros = context_.Empty(input.shape(), input.dtype());
    std::fill_n(zeros.raw(), zeros.bytes(), std::byte{0});
    return Gradient(Constant(context_, std::move(zeros)));
  }

 private:
  struct Visit {
    bool useful = false;     // leads to something that was asked for
    bool wanted = false;     // was asked for: its adjoint must survive
    InlineVector<Var, 1> d;  // adjoint of each output, summed over the uses met so far
    Gradient product;        // or that of a leaf which met one use
  };

  void Collect(Node* root) {
    StepVector<Node*> open({root}, context_.allocator<Node*>());
    visits_.try_emplace(root);
    while (!open.empty()) {
      Node* node = open.back();
      open.pop_back();
      order_.push_back(node);
      for (const auto& edge : node->edges) {
        if (edge.node && visits_.try_emplace(edge.node.get()).second) {
          open.push_back(edge.node.get());
        }
      }
    }
  }

  void MarkUseful(Node* node) {
    const auto it = visits_.find(node);
    if (it != visits_.end()) it->second.useful = it->second.wanted = true;
  }

  void Step(Node& node) {
    Visit& visit = visits_[&node];
    if (visit.d.empty()) return;  // nothing arrived: the derivative is zero
    if (node.released) {
      context_.Fail(InvalidArgument(
          "the graph of \"{}\" was released by an earlier Grad; ask that one to keep_graph",
          node.info.name));
      return;
    }
    const auto needs = Needs(node);
    // The output as a Var of this very node, so that a rule that uses it can be differentiated.
    const Var y = node.saved.empty() ? Var() : Var(context_, node.saved, node.shared_from_this());
    // What was asked for must survive the rule, which may take its adjoint.
    InlineVector<Var, 1> d = visit.wanted ? visit.d : std::move(visit.d);
    if (!visit.wanted) visit.d.clear();
    UncomputedAdjoint left;
    const Vars d_inputs = node.rule(Adjoint(y, d, needs, leave_products_ ? &left : nullptr));
    d.clear();
    for (std::size_t i = 0; i < d_inputs.size(); ++i) {
      if (needs[i] && d_inputs[i].valid()) {
        Deposit(node.edges[i].node.get(), node.edges[i].slot, d_inputs[i]);
      }
    }
    if (left.product.valid()) DepositProduct(node.edges[left.input], left.product);
    if (!options_.create_graph && !options_.keep_graph) Release(node);
  }

  InlineVector<std::uint8_t, 8> Needs(const Node& node) {
    InlineVector<std::uint8_t, 8> needs;
    for (const auto& edge : node.edges) {
      needs.push_back(edge.node && visits_[edge.node.get()].useful);
    }
    return needs;
  }

  static void Release(Node& node) {
    node.rule = nullptr;
    node.saved = Tensor();
    node.released = true;
  }

  void DepositProduct(const Node::Edge& edge, const Gradient& product) {
    Visit& visit = visits_[edge.node.get()];
    const bool first = edge.node->edges.empty() && visit.d.empty() && !visit.product.valid();
    if (first && !ReadsInputs(product)) {
      visit.product = product;
    } else {
      Deposit(edge.node.get(), edge.slot, product.Value());
    }
  }

  // Whether a factor is one of the inputs, which change before the product is used.
  bool ReadsInputs(const Gradient& product) const {
    return std::any_of(inputs_.begin(), inputs_.end(), [&](const Var& input) {
      return input.value().raw() == product.a().value().raw() ||
             input.value().raw() == product.b().value().raw();
    });
  }

  void Deposit(Node* node, int slot, const Var& d) {
    if (Visit& visit = visits_[node]; visit.product.valid()) {
      const Gradient before = std::exchange(visit.product, Gradient());
      Deposit(node, slot, before.Value());
    }
    auto& sums = visits_[node].d;
    sums.resize(static_cast<std::size_t>(node->slots));
    Var& sum = sums[static_cast<std::size_t>(slot)];
    sum = sum.valid() ? Accumulated(std::move(sum), d) : d;
  }

  Context& context_;
  const Var& output_;
  const GradOptions& options_;
  const bool leave_products_;
  std::span<const Var> inputs_;
  StepVector<Node*> order_;
  std::unordered_map<Node*, Visit, std::hash<Node*>, std::equal_to<>,
                     StepAllocator<std::pair<Node* const, Visit>>>
      visits_;
};

}  // namespace

double Var::item() const {
  if (!valid() || value_.elements() != 1) return std::numeric_limits<double>::quiet_NaN();
  return WithFloatType(dtype(), [&]<class T>(T) { return static_cast<double>(*value_.data<T>()); });
}

Var Constant(Context& context, Tensor value) { return Var(context, std::move(value)); }

Var Constant(Context& context, double value) { return Var(context, context.Full({}, value)); }

Var Parameter(Context& context, Tensor value) {
  return Var(context, std::move(value), MakeNode(context, {"parameter"}, {}));
}

Var Gradient::Value() const {
  return is_product() ? Matmul(first_, second_, {.transpose_a = true}) : first_;
}

Var Adjoint::Product(std::size_t input, const Var& a, const Var& b) const {
  if (left_ == nullptr) return Matmul(a, b, {.transpose_a = true});
  *left_ = {input, Gradient(a, b)};
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
      // Memory, errors and whether anything is recorded are of a context: two would each know half.
      for (Context* of : {&first.context(), &v->context()}) {
        of->Fail(InvalidArgument("{}: operands are of two contexts; copy one's tensor", op));
      }
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

bool Makeable(const char* op, const Var& operand, const Shape& result) {
  if (result.IsPossible()) return true;
  operand.context().Fail(InvalidArgument("{}: {} would give {}, which no tensor can be", op,
                                         operand.shape().ToString(), result.ToString()));
  return false;
}

namespace {

// Why Grad(output, ...) cannot be answered, or OK.
Status CheckGrad(const Var& output, const Var& d_output) {
  if (!d_output.has_context()) {
    if (output.value().elements() == 1) return {};
    return InvalidArgument("Grad: output has shape {}; give d_output or reduce it to one element",
                           output.shape().ToString());
  }
  if (d_output.valid() && d_output.shape() == output.shape() &&
      d_output.dtype() == output.dtype()) {
    return {};
  }
  return InvalidArgument("Grad: d_output has shape {}, output {}", d_output.shape().ToString(),
                         output.shape().ToString());
}

Var Ones(const Var& like) {
  Tensor ones = like.context().Empty(like.shape(), like.dtype());
  WithFloatType(like.dtype(),
                [&]<class T>(T) { std::fill_n(ones.data<T>(), ones.elements(), T(1)); });
  return Constant(like.context(), std::move(ones));
}

// The gradients as values or, where G is Gradient, also as products.
template <class G>
StepVector<G> Differentiate(const Var& output, std::span<const Var> inputs,
                            const GradOptions& options) {
  constexpr bool kProducts = std::is_same_v<G, Gradient>;
  StepAllocator<G> allocator;
  if (output.has_context()) allocator = output.context().allocator<G>();
  StepVector<G> result(inputs.size(), G(Invalid({&output})), allocator);
  if (!output.valid()) return result;
  Context& context = output.context();
  if (const Status status = CheckGrad(output, options.d_output); !status.ok()) {
    context.Fail(status);
    return result;
  }
  for (const Var& input : inputs) {
    if (input.valid() && input.requires_grad()) continue;
    context.Fail(InvalidArgument("Grad: an input is not part of a graph; make it by Parameter"));
    return result;
  }
  Backward walk(output, inputs, options, kProducts);
  walk.Run(options.d_output.valid() ? options.d_output : Ones(output));
  if (!context.status().ok()) return result;
  std::transform(inputs.begin(), inputs.end(), result.begin(), [&](const Var& input) -> G {
    if constexpr (kProducts) {
      return walk.Result(input);
    } else {
      return walk.Result(input).Value();
    }
  });
  return result;
}

}  // namespace

StepVector<Var> Grad(const Var& output, std::span<const Var> inputs, const GradOptions& options) {
  return Differentiate<Var>(output, inputs, options);
}

StepVector<Gradient> Gradients(const Var& output, std::span<const Var> parameters) {
  return Differentiate<Gradient>(output, parameters, {});
}

StepVector<Var> Grad(const Var& output, std::initializer_list<Var> inputs,
                     const GradOptions& options) {
  return Grad(output, std::span<const Var>(inputs.begin(), inputs.size()), options);
}

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
