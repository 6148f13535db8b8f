// SPDX-License-Identifier: Apache-2.0
// Operations on Vars, by family; each family has a file in ops/.
#pragma once

#include <initializer_list>
#include <limits>
#include <memory>
#include <span>

#include "base/function_ref.h"
#include "nn/tape.h"

namespace tilegrad::nn {

// ops/shape.cc: moves elements without computing. Each operation is linear, and the adjoint of
// another one.

struct ImageSize {
  std::int64_t height, width;
};

// Same elements, same order. One extent may be -1: it is derived from the others.
Var Reshape(const Var& x, Shape shape);
// Repeats axes of extent 1 (and missing leading ones); adjoint: SumTo.
Var BroadcastTo(const Var& x, const Shape& shape);
// y's axis i is x's axis axes[i].
Var Permute(const Var& x, std::span<const int> axes);
Var Permute(const Var& x, std::initializer_list<int> axes);
Var Transpose(const Var& x);  // of rank 2

// Elements [begin, end) of one axis. Adjoint: Pad.
Var Slice(const Var& x, int axis, std::int64_t begin, std::int64_t end);
// Zeros before and after along one axis. Adjoint: Slice.
Var Pad(const Var& x, int axis, std::int64_t before, std::int64_t after);
// Concatenates along `axis`; all other extents must be equal.
Var Concat(std::span<const Var> parts, int axis);
Var Concat(std::initializer_list<Var> parts, int axis);

// ops/pointwise.cc: elementwise. Binary operations broadcast like NumPy's: shapes are aligned at
// the last axis, and an axis of extent 1 (or a missing one) is repeated.

Var Add(const Var& a, const Var& b);
Var Sub(const Var& a, const Var& b);
Var Mul(const Var& a, const Var& b);
Var Div(const Var& a, const Var& b);

Var Neg(const Var& x);
Var Scale(const Var& x, double factor);
Var AddScalar(const Var& x, double term);
Var Exp(const Var& x);
Var Log(const Var& x);   // natural; NaN below 0, -inf at 0
Var Sqrt(const Var& x);  // infinite gradient at 0: add an epsilon first
Var Square(const Var& x);
Var Abs(const Var& x);                      // gradient 0 at 0
Var Relu(const Var& x);                     // gradient 0 at 0
Var LeakyRelu(const Var& x, double slope);  // x > 0 ? x : slope x; gradient slope at 0; slope >= 0
Var Softplus(const Var& x);                 // log(1 + e^x)
Var Tanh(const Var& x);
Var Sigmoid(const Var& x);

inline Var operator+(const Var& a, const Var& b) { return Add(a, b); }
inline Var operator-(const Var& a, const Var& b) { return Sub(a, b); }
inline Var operator*(const Var& a, const Var& b) { return Mul(a, b); }
inline Var operator/(const Var& a, const Var& b) { return Div(a, b); }
inline Var operator-(const Var& x) { return Neg(x); }
inline Var operator*(double s, const Var& x) { return Scale(x, s); }
inline Var operator*(const Var& x, double s) { return Scale(x, s); }
inline Var operator/(const Var& x, double s) { return Scale(x, 1.0 / s); }
inline Var operator+(const Var& x, double s) { return AddScalar(x, s); }
inline Var operator-(const Var& x, double s) { return AddScalar(x, -s); }
inline Var operator+(double s, const Var& x) { return AddScalar(x, s); }
inline Var operator-(double s, const Var& x) { return AddScalar(Neg(x), s); }

// The adjoint of Relu from its output y: y > 0 ? dy : 0. Overwrites dy if that is unshared and
// nothing is recorded.
Var ReluGrad(const Var& y, Var dy);

// sum + term, equal shapes. Overwrites `sum` if that is unshared and nothing is recorded.
Var Accumulated(Var sum, const Var& term);
Var Accumulated(Var sum, const AdjointPart& part);  // ops/shape.cc

// ops/reduce.cc: reductions over axes, which are dropped, or kept with extent 1 for broadcasting.

enum class Keep { kNo, kYes };

Var Sum(const Var& x, std::initializer_list<int> axes, Keep keep = Keep::kNo);
Var Sum(const Var& x);  // over everything: a scalar
Var Mean(const Var& x, std::initializer_list<int> axes, Keep keep = Keep::kNo);
Var Mean(const Var& x);

// Largest and smallest element over axes of extent > 0. The gradient goes to the first element (in
// memory order) that attains it. NaN wins.
Var ReduceMax(const Var& x, std::initializer_list<int> axes, Keep keep = Keep::kNo);
Var ReduceMin(const Var& x, std::initializer_list<int> axes, Keep keep = Keep::kNo);

// Sums over the axes that broadcasting to x's shape repeated. Adjoint of BroadcastTo.
Var SumTo(const Var& x, const Shape& shape);

// Softmax over one axis and classification losses. Subtracts the largest element before
// exponentiation, so that no finite input overflows.

// Both are NaN for inputs that are all -infinity or contain infinity: there is no such
// distribution.
Var Softmax(const Var& x, int axis);
Var LogSoftmax(const Var& x, int axis);

// logits [n, classes] -> mean over n of -log softmax[i, labels[i]]; labels: [n] of kI32.
Var CrossEntropy(const Var& logits, const Tensor& labels);

// ops/index.cc: gather and scatter. Each operation is linear, and the adjoint of another one.

// y[.., i, ..] = x[.., indices[i], ..] along `axis`; indices: [n] of kI32 within the extent, else
// an error. Adjoint: ScatterAdd.
Var Gather(const Var& x, int axis, const Tensor& indices);
// y of extent `extent` along `axis`: y[.., indices[i], ..] += x[.., i, ..], in the order of i.
Var ScatterAdd(const Var& x, int axis, const Tensor& indices, std::int64_t extent);

// y[.., i] = x[.., indices[.., i]] along the last axis: indices [.., n] of kI32, separate for each
// row, within the extent, else an error. Adjoint: PlaceAlong.
Var TakeAlong(const Var& x, const Tensor& indices);
// y[.., indices[.., i]] += x[.., i], in the order of i; y's last axis has `extent` elements.
Var PlaceAlong(const Var& x, const Tensor& indices, std::int64_t extent);

// ops/axis_map.cc: a sparse linear map along one axis, with padding and resizing as special cases.
// Its adjoint is the map of the transposed matrix, so the operation is closed under
// differentiation.

// A sparse matrix [out, in] in compressed rows (CSR).
struct AxisMap {
  // Limit for `in` and `out`, required by MakeAxisMap.
  static constexpr std::int64_t kMostExtent = std::numeric_limits<std::int32_t>::max();

  std::int64_t in = 0, out = 0;
  Tensor begin;   // [out + 1] of kI32: row i has the terms begin[i] .. begin[i + 1]
  Tensor index;   // [terms] of kI32, below `in`
  Tensor weight;  // [terms]
  // The transposed matrix for the adjoint, shared by copies. Has no tensors until first needed.
  std::shared_ptr<AxisMap> transposed;
};

struct AxisTerm {
  std::int64_t index;
  double weight;
};
using AxisTerms = StepVector<AxisTerm>;

// `row(i, terms)` appends the terms of row i.
struct AxisExtents {
  std::int64_t in, out;
};
AxisMap MakeAxisMap(const Var& like, const AxisExtents& extents,
                    FunctionRef<void(std::int64_t i, AxisTerms& terms)> row);

// y[.., i, ..] = sum_t weight[t] x[.., index[t], ..] over the terms t of row i.
Var MapAxis(const Var& x, int axis, const AxisMap& map);
// The last two axes of [n, c, h, w], h first.
Var MapImage(const Var& x, const AxisMap& rows, const AxisMap& columns);

// Padding a b c by two elements on each side:
enum class PadMode {
  kZero,      // 0 0 a b c 0 0
  kCircular,  // b c a b c a b: wrap-around textures
  kReplicate  // a a a b c c c
};

Var Pad(const Var& x, int axis, std::int64_t before, std::int64_t after, PadMode mode);

struct Padding {
  std::int64_t top = 0, bottom = 0, left = 0, right = 0;
  static Padding All(std::int64_t n) { return {n, n, n, n}; }
};
struct PadModes {
  PadMode vertical, horizontal;
};
// Pads the last two axes of [n, c, h, w].
Var PadImage(const Var& x, const Padding& padding, const PadModes& modes);
inline Var PadImage(const Var& x, const Padding& padding, PadMode mode) {
  return PadImage(x, padding, {mode, mode});
}

// Image resizing. Pixels are squares and both images fill the same square, as in PyTorch with
// align_corners = False: output i is centred at (i + 1/2) in / out - 1/2 of the input.

enum class ResizeMode {
  kNearest,  // element floor(i in / out)
  kBilinear  // of the two neighbours; edges are replicated
};

// x [n, c, h, w] -> [n, c, size.height, size.width].
Var Resize(const Var& x, ImageSize size, ResizeMode mode);

// ops/conv.cc: means and maxima over windows of images [n, c, h, w] -> [n, c,
// (h + 2 padding - kernel) / stride + 1, ...].

struct PoolOptions {
  int kernel = 2;   // side of the window
  int stride = 2;   // >= 1
  int padding = 0;  // on every side, at most kernel / 2
};

// Counts padded zeros.
Var AvgPool2d(const Var& x, const PoolOptions& options);

// Padding never wins. The gradient goes to the first element of a window, in memory order, that
// attains its maximum; NaN wins.
Var MaxPool2d(const Var& x, const PoolOptions& options);

// ops/matmul.cc: matrix products.

struct MatmulOptions {
  bool transpose_a = false;
  bool transpose_b = false;
};

// op(a) op(b) of rank 2: [m, k] [k, n] -> [m, n].
Var Matmul(const Var& a, const Var& b, const MatmulOptions& options = {});

// x w^T + b: x [n, in], w [out, in], b [out] or an invalid Var for none -> [n, out].
Var Linear(const Var& x, const Var& w, const Var& b);

// ops/conv.cc: cross-correlation of images (the field's convolution), and its two derivatives. Each
// of the three is the derivative of the others, so together they are closed.

struct ConvOptions {
  int stride = 1;                         // >= 1
  int padding = 0;                        // pixels added on every side, >= 0
  PadMode padding_mode = PadMode::kZero;  // the two gradients support only zero
};

// x [n, in, h, w], weight [out, in, kh, kw], bias [out] or an invalid Var for none ->
// [n, out, (h + 2 padding - kh) / stride + 1, ...], rounded down.
Var Conv2d(const Var& x, const Var& weight, const Var& bias, const ConvOptions& options);

// The adjoint by x: dy [n, out, oh, ow] -> [n, in, height, width].
Var Conv2dInputGrad(const Var& dy, const Var& weight, ImageSize size, const ConvOptions& options);

// The adjoint by the weight -> [out, in, kernel.height, kernel.width].
Var Conv2dWeightGrad(const Var& x, const Var& dy, ImageSize kernel, const ConvOptions& options);

// ops/batch_norm.cc: batch normalisation (Ioffe, Szegedy 2015), optionally followed by ReLU in the
// same pass.

struct BatchNormOptions {
  double epsilon = 1e-5;
  bool relu = false;  // y = max(0, normalised)
};

struct BatchNormResult {
  Var y;
  Tensor mean;      // [c] of this batch
  Tensor variance;  // [c], biased: divided by the count
};

// x [n, c] or [n, c, h, w]; gamma, beta [c]; statistics over all axes but c, which must have at
// least two elements. y = gamma (x - mean) / sqrt(variance + epsilon) + beta.
BatchNormResult BatchNormTrain(const Var& x, const Var& gamma, const Var& beta,
                               const BatchNormOptions& options = {});

// Normalises with given statistics, which get no gradient.
struct BatchStatistics {
  Tensor mean, variance;  // [c]
};
Var BatchNormEval(const Var& x, const Var& gamma, const Var& beta,
                  const BatchStatistics& statistics, const BatchNormOptions& options = {});

// ops/sample_pictures.cc: samples pictures at predicted positions: CMR's texture flow
// (Kanazawa et al., ECCV 2018, section 2.2).

// pictures [B, C, H, W], without gradient; flow [B, 2, h, w]: x and y in [-1, 1] across the
// picture, x right, y down. Returns [B, C, h, w], bilinear between pixel centres; clamped at the
// edges, where the gradient by flow is 0.
Var SamplePictures(const Tensor& pictures, const Var& flow);

// Looks colours up in the picture instead of predicting them: for each vertex the network predicts
// a position, a width, and how much brighter or darker than the picture it is. A soft form of the
// texture flow of Kanazawa et al. (ECCV 2018).

// images: [B, 4, size, size], RGB over black and alpha, without gradient; size is a multiple of 16.
// Averages them over 16 x 16 cells.
// flow: [B, V, 4]: (x, y) in [-1, 1] across the picture, x to the right and y down; n: the variance
// of the bell around (x, y) is (1/8)^2 + e^-n, and unbounded below n = -20; g: the colour is 1 + g
// times the mean under the bell, over what the object covers. Any finite number is allowed. Returns
// [B, V, 3], linear like the picture, not clamped. First derivative only.
Var SampleColors(const Tensor& images, const Var& flow);

}  // namespace tilegrad::nn
