// SPDX-License-Identifier: Apache-2.0
// Products of matrices.
#pragma once

#include "nn/tape.h"

namespace tilegrad::nn {

struct MatmulOptions {
  bool transpose_a = false;
  bool transpose_b = false;
};

// op(a) op(b) of rank 2: [m, k] [k, n] -> [m, n].
Var Matmul(const Var& a, const Var& b, const MatmulOptions& options = {});

// x w^T + b: x [n, in], w [out, in], b [out] or an invalid Var for none -> [n, out].
Var Linear(const Var& x, const Var& w, const Var& b);

}  // namespace tilegrad::nn
