// SPDX-License-Identifier: Apache-2.0
// Reverse-mode differentiation. A Var is a tensor that knows how it was computed; Grad walks that
// graph backwards. Each operation's backward rule uses the same operations on Vars, so the gradient
// is itself a Var that can be differentiated again, to any order:
//
//   Var loss = Mean(Square(Linear(x, w, b) - y));
//   auto d = Grad(loss, {w, b});  // d[0]: dL/dw, d[1]: dL/db
//
// Read first: Record in this file, then any file of ops/.
#pragma once

#include <cstdint>
#include <functional>
#include <initializer_list>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/function_ref.h"
#include "base/inline_vector.h"
#include "nn/context.h"
#include "nn/tensor.h"

namespace tilegrad::nn {

struct Node;

// A value and its position in the graph. Cheap to copy; copies share tensor and node.
class Var {
 public:
  Var() = default;  // invalid, without a context
  Var(Context& context, Tensor value, std::shared_ptr<Node> node = nullptr, int slot = 0)
      : context_(&context), value_(std::move(value)), node_(std::move(node)), slot_(slot) {}

  bool valid() const { return !value_.empty(); }
  Context& context() const { return *context_; }  // not for a default-constructed Var
  const Tensor& value() const { return value_; }
  Tensor& value() { return value_; }  // for optimisers to write; not while a graph still needs it
  const Shape& shape() const { return value_.shape(); }
  DType dtype() const { return value_.dtype(); }
  bool requires_grad() const { return node_ != nullptr; }
  double item() const;  // the number of a one-element Var; NaN if invalid

  const std::shared_ptr<Node>& node() const { return node_; }
  int slot() const { return slot_; }  // output index of the node
  bool has_context() const { return context_ != nullptr; }

 private:
  Context* context_ = nullptr;
  Tensor value_;
  std::shared_ptr<Node> node_;
  int slot_ = 0;
};

Var Constant(Context& context, Tensor value);   // no gradient flows into it
Var Constant(Context& context, double value);   // a scalar
Var Parameter(Context& context, Tensor value);  // Grad can differentiate by it
Var Detach(const Var& x);                       // the value of x, detached from its graph

struct GradOptions {
  bool create_graph = false;  // keep the graph of `output`; gradients are differentiable
  bool keep_graph = false;    // keep it although create_graph is off; else the walk releases it
  Var d_output = {};          // adjoint of `output`, of its shape; default: 1 for one element
};

// d output / d inputs[i], with the shapes of `inputs`; zeros if output does not depend on it. On
// errors (output has more than one element and no d_output, a released graph, an operand of a
// first-order operation in a second derivative) the context records it and every entry is invalid.
StepVector<Var> Grad(const Var& output, std::span<const Var> inputs,
                     const GradOptions& options = {});
StepVector<Var> Grad(const Var& output, std::initializer_list<Var> inputs,
                     const GradOptions& options = {});

// A gradient for optimisers: a value, or a product a^T b of matrices [k, m] and [k, n], not yet
// computed. A linear layer's weight has such a gradient (a: the adjoint of the layer's output, b:
// its input): Adam computes it block by block and uses each block at once, so that the whole, as
// large as the weight, is never in memory. Or the mean of such products over portions of the k
// rows, a power of two of them, summed in the order of one binary tree.
class Gradient {
 public:
  Gradient() = default;  // invalid
  explicit Gradient(Var value) : first_(std::move(value)) {}
  Gradient(const Var& a, const Var& b, std::int64_t portions = 1)
      : first_(Detach(a)), second_(Detach(b)), portions_(portions) {}

  bool valid() const { return first_.valid(); }
  bool is_product() const { return second_.valid(); }
  const Var& a() const { return first_; }  // of a product, like b()
  const Var& b() const { return second_; }
  std::int64_t portions() const { return portions_; }
  Shape shape() const {
    return is_product() ? Shape{first_.shape()[1], second_.shape()[1]} : first_.shape();
  }
  DType dtype() const { return first_.dtype(); }
  Var Value() const;  // computes a product at every call

 private:
  Var SumOf(std::int64_t first, std::int64_t count) const;
  Var first_, second_;
  std::int64_t portions_ = 1;
};

// Receives each gradient as soon as it is final, while those of earlier layers are still pending,
// so that sums over processes can begin.
class GradientListener {
 public:
  virtual ~GradientListener() = default;
  virtual void Begin(std::span<const Var> parameters) = 0;
  // For parameters[i]: each once unless the walk fails, in an order determined by the graph.
  virtual void Ready(std::size_t i, const Gradient& gradient) = 0;
};

// Grad without options, for an optimiser. Products read a and b when they are used: until then, of
// all that the output was computed from, only `parameters` may be overwritten. `listener` may be
// null.
StepVector<Gradient> Gradients(const Var& output, std::span<const Var> parameters,
                               GradientListener* listener = nullptr);

// An operation computed elsewhere (a renderer, a loss) with a first derivative only. `backward`
// receives one adjoint per output (empty Tensor: zero) and returns one per input (empty Tensor:
// zero), of the input's shape and dtype.
struct ExternalOp {
  const char* name = "external";
  std::vector<Var> inputs = {};
  std::vector<Tensor> outputs = {};
  std::function<std::vector<Tensor>(std::span<const Tensor> d_outputs)> backward = {};
};
std::vector<Var> External(Context& context, ExternalOp op);

// ---- For authors of operations ----

// An adjoint that is zero but for elements [before, before + extent of value) of an axis, `after`
// of which follow.
struct AdjointPart {
  Var value;
  int axis = 0;
  std::int64_t before = 0, after = 0;
};

// The adjoint of an input: a product, or a part.
struct UncomputedAdjoint {
  std::size_t input = 0;
  Gradient product = {};
  AdjointPart part = {};
};

// The input of a backward rule: the adjoints of the outputs, and which gradients are needed.
class Adjoint {
 public:
  // `left`: where a rule may leave an adjoint uncomputed, or null.
  Adjoint(const Var& y, std::span<Var> d_outputs, std::span<const std::uint8_t> needs,
          UncomputedAdjoint* left)
      : y_(y), d_outputs_(d_outputs), needs_(needs), left_(left) {}
  const Var& dy() const { return d_outputs_[0]; }
  // dy() for an operation that may overwrite it: call once, and do not call dy() afterwards.
  Var TakeDy() const { return std::move(d_outputs_[0]); }
  std::span<const Var> d_outputs() const { return d_outputs_; }
  const Var& y() const { return y_; }  // the output, if the operation saved it
  bool needs(std::size_t input) const { return needs_[input] != 0; }
  // The adjoint of `input` is a^T b: returns that or, if it is not needed at once, defers it to its
  // consumer and returns an invalid Var. For one input per operation.
  Var Product(std::size_t input, const Var& a, const Var& b) const;
  // The same for a part: its consumer adds parts into one sum, where each alone would be padded.
  Var Part(std::size_t input, const AdjointPart& part) const;

 private:
  const Var& y_;
  std::span<Var> d_outputs_;
  std::span<const std::uint8_t> needs_;
  UncomputedAdjoint* left_;
};

// Returns the adjoint of each input; an invalid Var if it is zero or not needed.
// Captures may take half a kilobyte: a few Vars.
using Vars = InlineVector<Var, 4>;
using Rule = InlineFunction<Vars(const Adjoint&), 512>;

struct OpInfo {
  const char* name;          // for messages
  bool save_output = false;  // the rule reads Adjoint::y()
};

// Creates the Var of an operation's result. Keeps the rule only if a gradient can be requested.
Var Record(const OpInfo& info, Tensor value, std::span<const Var> inputs, Rule rule);
Var Record(const OpInfo& info, Tensor value, std::initializer_list<Var> inputs, Rule rule);

// Records `status` in the operand's context and returns an invalid Var of it.
Var Fail(const Var& operand, Status status);
// The same with InvalidArgument(format, arguments...).
template <class... A>
Var Refuse(const Var& operand, fmt::format_string<A...> format, A&&... arguments) {
  return Fail(operand, InvalidArgument(format, std::forward<A>(arguments)...));
}
// True if all are valid, of one context and of float dtype; else records why in the contexts of
// `operands`.
bool Usable(const char* op, std::initializer_list<const Var*> operands);
// True if a tensor can have the shape of a result; else records why in the context of `operand`.
bool IsPossibleResult(const char* op, const Var& operand, const Shape& result);
// The invalid result of an operation with an invalid operand.
Var Invalid(std::initializer_list<const Var*> operands);

}  // namespace tilegrad::nn
