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

Status CheckSpectral(const Var& weight, const SpectralVectors& at) {
  const std::int64_t out = weight.shape().rank() >= 2 ? weight.shape()[0] : 0;
  const std::int64_t rest = out > 0 ? weight.shape().elements() / out : 0;
  const auto fits = [&](const Tensor& t, std::int64_t n) {
    return !t.empty() && t.dtype() == weight.dtype() && t.shape() == Shape{n};
  };
  if (rest > 0 && fits(at.u, out) && fits(at.v, rest)) return {};
  return InvalidArgument("spectral norm: weight {}, u {}, v {}", weight.shape().ToString(),
                         at.u.shape().ToString(), at.v.shape().ToString());
}

Var AsMatrix(const Var& weight) { return Reshape(weight, {weight.shape()[0], -1}); }
Var AsRow(const Var& weight, const Tensor& x) {
  return Constant(weight.context(), x.Reshaped({1, x.shape()[0]}));
}

// *to <- row / |row|, unless that is no number: a zero matrix turns nothing.
void SetNormalised(const Var& row, Tensor* to) {
  const Var length = Sqrt(Sum(Square(row)));
  if (!(length.item() > 0) || !std::isfinite(length.item())) return;
  std::memcpy(to->raw(), Div(row, length).value().raw(), to->bytes());
}

}  // namespace

Var SpectralNorm(const Var& weight, const SpectralVectors& at) {
  if (!Usable("spectral norm", {&weight})) return Invalid({&weight});
  if (const Status s = CheckSpectral(weight, at); !s.ok()) return Fail(weight, s);
  const Var left = Matmul(AsRow(weight, at.u), AsMatrix(weight));  // [1, rest]
  return Div(weight, Sum(Mul(left, AsRow(weight, at.v))));
}

void SpectralRightVector(const Var& weight, SpectralVectors& at) {
  if (!Usable("spectral norm", {&weight})) return;
  if (const Status s = CheckSpectral(weight, at); !s.ok()) return weight.context().Fail(s);
  const NoGrad off(weight.context());
  SetNormalised(Matmul(AsRow(weight, at.u), AsMatrix(weight)), &at.v);
}

void SpectralStep(const Var& weight, SpectralVectors& at) {
  SpectralRightVector(weight, at);
  if (!Usable("spectral norm", {&weight}) || !CheckSpectral(weight, at).ok()) return;
  const NoGrad off(weight.context());
  SetNormalised(Matmul(AsRow(weight, at.v), AsMatrix(weight), {false, true}), &at.u);
}

}  // namespace tilegrad::nn
