// SPDX-License-Identifier: Apache-2.0
// Derivatives: walks over the graph from an output back to the requested inputs.
#include <algorithm>
#include <type_traits>
#include <unordered_map>
#include <utility>

#include "base/error.h"
#include "nn/ops.h"
#include "nn/tape.h"
#include "nn/tape_node.h"

namespace tilegrad::nn {

namespace {

// One walk backwards over the graph of `output`.
class Backward {
 public:
  struct Consumer {
    bool leave_products = false;  // that are the whole gradient of an input: left to the caller
    GradientListener* listener = nullptr;
  };
  Backward(const Var& output, std::span<const Var> inputs, const GradOptions& options,
           const Consumer& consumer)
      : context_(output.context()),
        output_(output),
        options_(options),
        consumer_(consumer),
        inputs_(inputs),
        order_(context_.allocator<Node*>()),
        visits_(context_.allocator<std::pair<Node* const, Visit>>()) {
    if (output.requires_grad()) Collect(output.node().get());
    for (std::size_t i = 0; i < inputs.size(); ++i) MarkUseful(inputs[i].node().get(), i);
    std::sort(order_.begin(), order_.end(),
              [](const Node* a, const Node* b) { return a->order < b->order; });
    for (Node* node : order_) {
      for (const auto& edge : node->edges) {
        if (edge.node && visits_[edge.node.get()].useful) visits_[node].useful = true;
      }
    }
    if (consumer_.listener != nullptr) CountUses();
  }

  void Run(const Var& d_output) {
    const RecordingScope recording(context_, options_.create_graph);
    if (output_.requires_grad()) Deposit(output_.node().get(), output_.slot(), d_output);
    if (consumer_.listener != nullptr) consumer_.listener->Begin(inputs_);
    for (auto it = order_.rbegin(); it != order_.rend() && context_.status().ok(); ++it) {
      if (!visits_[*it].useful || (*it)->edges.empty()) continue;
      Step(**it);
      if (consumer_.listener != nullptr) Announce(**it);
    }
    if (consumer_.listener != nullptr && context_.status().ok()) AnnounceUnused();
  }

  Gradient Result(const Var& input) {
    const auto it = visits_.find(input.node().get());
    if (it != visits_.end() && it->second.product.valid()) return it->second.product;
    if (it != visits_.end() && !it->second.d.empty()) {
      const Var& d = it->second.d[static_cast<std::size_t>(input.slot())];
      if (d.valid()) return Gradient(d);
    }
    return Gradient(Constant(context_, context_.Zeros(input.shape(), input.dtype())));
  }

 private:
  struct Visit {
    bool useful = false;     // leads to a requested input
    bool wanted = false;     // is a requested input: its adjoint must survive
    InlineVector<Var, 1> d;  // adjoint of each output, summed over the uses met so far
    Gradient product;        // or that of a leaf which met one use
    // For a listener, of a requested input: its index, and the number of uses not yet met.
    std::size_t input = 0, uses = 0;
    bool announced = false;
  };

  void Collect(Node* root) {
    StepVector<Node*> open({root}, context_.allocator<Node*>());
    visits_.try_emplace(root);
    while (!open.empty()) {
      Node* node = open.back();
      open.pop_back();
      order_.push_back(node);
      for (const auto& edge : node->edges) {
        if (edge.node && visits_.try_emplace(edge.node.get()).second)
          open.push_back(edge.node.get());
      }
    }
  }

  void MarkUseful(Node* node, std::size_t input) {
    const auto it = visits_.find(node);
    if (it == visits_.end()) return;
    it->second.useful = it->second.wanted = true;
    it->second.input = input;
  }

  void CountUses() {
    for (const Node* node : order_) {
      if (!visits_[const_cast<Node*>(node)].useful) continue;
      for (const auto& edge : node->edges) {
        if (edge.node) ++visits_[edge.node.get()].uses;
      }
    }
  }

  // Announces the inputs whose last use was `node`.
  void Announce(const Node& node) {
    for (const auto& edge : node.edges) {
      if (!edge.node || !context_.status().ok()) continue;
      Visit& visit = visits_[edge.node.get()];
      if (--visit.uses > 0 || !visit.wanted) continue;
      visit.announced = true;
      consumer_.listener->Ready(visit.input, Result(inputs_[visit.input]));
    }
  }

  // Announces the other inputs, which nothing uses.
  void AnnounceUnused() {
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      const auto it = visits_.find(inputs_[i].node().get());
      if (it == visits_.end() || !it->second.announced)
        consumer_.listener->Ready(i, Result(inputs_[i]));
    }
  }

  void Step(Node& node) {
    Visit& visit = visits_[&node];
    if (visit.d.empty()) return;  // no adjoint arrived: the derivative is zero
    if (node.released) {
      context_.Fail(InvalidArgument(
          "the graph of \"{}\" was released by an earlier Grad; give that one keep_graph",
          node.info.name));
      return;
    }
    const auto needs = Needs(node);
    // The output as a Var of this very node, so that a rule that uses it can be differentiated.
    const Var y = node.saved.empty() ? Var() : Var(context_, node.saved, node.shared_from_this());
    // A requested adjoint must survive the rule, which may overwrite it.
    InlineVector<Var, 1> d = visit.wanted ? visit.d : std::move(visit.d);
    if (!visit.wanted) visit.d.clear();
    UncomputedAdjoint left;
    const Vars d_inputs =
        node.rule(Adjoint(y, d, needs, consumer_.leave_products ? &left : nullptr));
    d.clear();
    for (std::size_t i = 0; i < d_inputs.size(); ++i) {
      if (needs[i] && d_inputs[i].valid())
        Deposit(node.edges[i].node.get(), node.edges[i].slot, d_inputs[i]);
    }
    if (left.product.valid()) DepositProduct(node.edges[left.input], left.product);
    if (left.part.value.valid()) DepositPart(node.edges[left.input], left.part);
    if (!options_.create_graph && !options_.keep_graph) Release(node);
  }

  InlineVector<std::uint8_t, 8> Needs(const Node& node) {
    InlineVector<std::uint8_t, 8> needs;
    for (const auto& edge : node.edges)
      needs.push_back(edge.node && visits_[edge.node.get()].useful);
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

  void DepositPart(const Node::Edge& edge, const AdjointPart& part) {
    Visit& visit = visits_[edge.node.get()];
    const auto slot = static_cast<std::size_t>(edge.slot);
    if (slot < visit.d.size() && visit.d[slot].valid()) {
      visit.d[slot] = Accumulated(std::move(visit.d[slot]), part);
    } else {
      Deposit(edge.node.get(), edge.slot, Pad(part.value, part.axis, part.before, part.after));
    }
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
  const Consumer consumer_;
  std::span<const Var> inputs_;
  StepVector<Node*> order_;
  std::unordered_map<Node*, Visit, std::hash<Node*>, std::equal_to<>,
                     StepAllocator<std::pair<Node* const, Visit>>>
      visits_;
};

// Why Grad(output, ...) cannot be answered, or OK.
Status CheckGrad(const Var& output, const Var& d_output) {
  if (!d_output.has_context()) {
    if (output.value().elements() == 1) return {};
    return InvalidArgument("Grad: output has shape {}; give d_output or reduce it to one element",
                           output.shape());
  }
  if (d_output.valid() && d_output.shape() == output.shape() &&
      d_output.dtype() == output.dtype()) {
    return {};
  }
  return InvalidArgument("Grad: d_output has shape {}, output {}", d_output.shape(),
                         output.shape());
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
                            const GradOptions& options, GradientListener* listener = nullptr) {
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
  Backward walk(output, inputs, options, {kProducts, listener});
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

StepVector<Gradient> Gradients(const Var& output, std::span<const Var> parameters,
                               GradientListener* listener) {
  return Differentiate<Gradient>(output, parameters, {}, listener);
}

StepVector<Var> Grad(const Var& output, std::initializer_list<Var> inputs,
                     const GradOptions& options) {
  return Grad(output, std::span<const Var>(inputs.begin(), inputs.size()), options);
}

}  // namespace tilegrad::nn
