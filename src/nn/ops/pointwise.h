// SPDX-License-Identifier: Apache-2.0
// Element by element. Binary operations broadcast as NumPy does: shapes are aligned at the last
// axis, and an axis of extent 1 (or a missing one) is repeated.
#pragma once

#include "nn/tape.h"

namespace tilegrad::nn {

Var Add(const Var& a, const Var& b);
Var Sub(const Var& a, const Var& b);
Var Mul(const Var& a, const Var& b);
Var Div(const Var& a, const Var& b);

Var Neg(const Var& x);
Var Scale(const Var& x, double factor);
Var AddScalar(const Var& x, double term);
Var Exp(const Var& x);
Var Log(const Var& x);   // natural; NaN below 0, -inf at 0
Var Sqrt(const Var& x);  // gradient infinite at 0: add an epsilon before
Var Square(const Var& x);
Var Abs(const Var& x);                      // gradient 0 at 0
Var Relu(const Var& x);                     // gradient 0 at 0
Var LeakyRelu(const Var& x, double slope);  // x > 0 ? x : slope x; slope at 0; slope >= 0
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

// The adjoint of Relu from its output y: y > 0 ? dy : 0. In dy's memory if that is unshared and
// nothing is recorded.
Var ReluGrad(const Var& y, Var dy);

// sum + term, equal shapes, in sum's memory if that is unshared and nothing is recorded.
Var Accumulated(Var sum, const Var& term);

}  // namespace tilegrad::nn
