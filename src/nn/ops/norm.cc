// SPDX-License-Identifier: Apache-2.0
#include "nn/ops/norm.h"

#include <cmath>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "nn/ops/batch_norm.h"
#include "nn/ops/matmul.h"
#include "nn/ops/pointwise.h"
#include "nn/ops/reduce.h"
#include "nn/ops/shape.h"

namespace tilegrad::nn {
namespace {

// Normalises each of `rows` runs of x to mean 0 and variance 1; in x's shape.
Var Standardised(const Var& x, std::int64_t rows, const NormOptions& options) {
  Context& context = x.context();
  const auto filled = [&](double value) {
    Tensor t = context.Empty({rows}, x.dtype());
    WithFloatType(x.dtype(), [&]<class T>(T) {
      std::fill_n(t.data<T>(), t.elements(), static_cast<T>(value));
    });
    return Constant(context, std::move(t));
  };
  const Var flat = Reshape(x, {1, rows, 1, -1});
  const Var y = BatchNormTrain(flat, filled(1), filled(0), {.epsilon = options.epsilon}).y;
  return Reshape(y, x.shape());
}

// gamma x + beta with both of shape [c], for x [n, c, ..].
Var Affine(const Var& x, const Var& gamma, const Var& beta) {
  Shape channels = {gamma.shape()[0]};
  for (int axis = 2; axis < x.shape().rank(); ++axis) channels.Append(1);
  return Add(Mul(x, Reshape(gamma, channels)), Reshape(beta, channels));
}

Status CheckChannels(const char* op, const Shape& x, const Var& gamma, const Var& beta) {
  const bool known = x.rank() == 2 || x.rank() == 4;
  if (known && gamma.shape() == Shape{x[1]} && beta.shape() == gamma.shape() && x.elements() > 0) {
    return {};
  }
  return InvalidArgument("{}: input {}, gamma {}, beta {}", op, x.ToString(),
                         gamma.shape().ToString(), beta.shape().ToString());
}

}  // namespace

Var InstanceNorm(const Var& x, const Var& gamma, const Var& beta, const NormOptions& options) {
  if (!Usable("instance norm", {&x, &gamma, &beta})) return Invalid({&x, &gamma, &beta});
  Status status = CheckChannels("instance norm", x.shape(), gamma, beta);
  if (status.ok() && x.shape().rank() != 4) {
    status = InvalidArgument("instance norm: {} is not [n, c, h, w]", x.shape().ToString());
  }
  if (!status.ok()) return Fail(x, status);
  const std::int64_t n = x.shape()[0], c = x.shape()[1];
  // One gamma and beta to each image of each channel.
  const auto repeated = [&](const Var& v) { return Reshape(BroadcastTo(v, {n, c}), {n * c}); };
  const Var planes = Reshape(x, {1, n * c, x.shape()[2], x.shape()[3]});
  const BatchNormOptions batch{.epsilon = options.epsilon};
  return Reshape(BatchNormTrain(planes, repeated(gamma), repeated(beta), batch).y, x.shape());
}

Var GroupNorm(const Var& x, int groups, const Var& gamma, const Var& beta,
              const NormOptions& options) {
  if (!Usable("group norm", {&x, &gamma, &beta})) return Invalid({&x, &gamma, &beta});
  Status status = CheckChannels("group norm", x.shape(), gamma, beta);
  if (status.ok() && (groups < 1 || x.shape()[1] % groups != 0)) {
    status = InvalidArgument("group norm: {} channels in {} groups", x.shape()[1], groups);
  }
  if (!status.ok()) return Fail(x, status);
  if (groups == x.shape()[1] && x.shape().rank() == 4) return InstanceNorm(x, gamma, beta, options);
  return Affine(Standardised(x, x.shape()[0] * groups, options), gamma, beta);
}

Var LayerNorm(const Var& x, const Var& gamma, const Var& beta, const NormOptions& options) {
  if (!Usable("layer norm", {&x, &gamma, &beta})) return Invalid({&x, &gamma, &beta});
  const int rank = x.shape().rank(), first = rank - gamma.shape().rank();
  bool fits =
      first >= 0 && first < rank && beta.shape() == gamma.shape() && x.shape().elements() > 0;
  for (int axis = first; fits && axis < rank; ++axis) {
    fits = x.shape()[axis] == gamma.shape()[axis - first];
  }
  if (!fits) {
    return Fail(x, InvalidArgument("layer norm: input {}, gamma {}, beta {}", x.shape().ToString(),
                                   gamma.shape().ToString(), beta.shape().ToString()));
  }
  return Add(Mul(Standardised(x, x.shape().Product(0, first), options), gamma), beta);
}

namespace {

Status CheckSpectral(const Var& weight, const Tensor& u) {
  if (weight.shape().rank() >= 2 && !u.empty() && u.dtype() == weight.dtype() &&
      u.shape() == Shape{weight.shape()[0]}) {
    return {};
  }
  return InvalidArgument("spectral norm: weight {}, u {}", weight.shape().ToString(),
                         u.shape().ToString());
}

// u^T W as [1, rest], with W = weight as [out, rest].
Var LeftProduct(const Var& weight, const Tensor& u) {
  const Var row = Constant(weight.context(), u.Reshaped({1, u.shape()[0]}));
  return Matmul(row, Reshape(weight, {weight.shape()[0], -1}));
}

}  // namespace

Var SpectralNorm(const Var& weight, const Tensor& u) {
  if (!Usable("spectral norm", {&weight})) return Invalid({&weight});
  if (const Status s = CheckSpectral(weight, u); !s.ok()) return Fail(weight, s);
  return Div(weight, Sqrt(Sum(Square(LeftProduct(weight, u)))));
}

void SpectralStep(const Var& weight, Tensor& u) {
  if (!Usable("spectral norm", {&weight})) return;
  if (const Status s = CheckSpectral(weight, u); !s.ok()) return weight.context().Fail(s);
  const NoGrad off(weight.context());
  const Var matrix = Reshape(weight, {weight.shape()[0], -1});
  const Var turned = Matmul(LeftProduct(weight, u), matrix, {false, true});  // [1, out]
  const Var length = Sqrt(Sum(Square(turned)));
  if (!(length.item() > 0) || !std::isfinite(length.item())) return;  // a zero matrix turns nothing
  std::memcpy(u.raw(), Div(turned, length).value().raw(), u.bytes());
}

}  // namespace tilegrad::nn
