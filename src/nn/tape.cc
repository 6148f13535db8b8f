// SPDX-License-Identifier: Apache-2.0
#include "nn/tape.h"

#include <limits>
#include <utility>

#include "base/error.h"
#include "nn/ops/matmul.h"
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
      // Memory, errors and recording belong to a context: with two, each would know half.
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

bool IsPossibleResult(const char* op, const Var& operand, const Shape& result) {
  if (result.IsPossible()) return true;
  operand.context().Fail(InvalidArgument("{}: {} would give {}, which no tensor can be", op,
                                         operand.shape().ToString(), result.ToString()));
  return false;
}

}  // namespace tilegrad::nn
