// SPDX-License-Identifier: Apache-2.0
// Elements picked by index, and put back: each is linear, and is the adjoint of another one.
#pragma once

#include "nn/tape.h"

namespace tilegrad::nn {

// y[.., i, ..] = x[.., indices[i], ..] along `axis`; indices: [n] of kI32 within the extent, else
// an error. Adjoint: ScatterAdd.
Var Gather(const Var& x, int axis, const Tensor& indices);
// y of extent `extent` along `axis`: y[.., indices[i], ..] += x[.., i, ..], in the order of i.
Var ScatterAdd(const Var& x, int axis, const Tensor& indices, std::int64_t extent);

// y[.., i] = x[.., indices[.., i]] along the last axis: indices [.., n] of kI32, other ones for
// each row, within the extent, else an error. Adjoint: PlaceAlong.
Var TakeAlong(const Var& x, const Tensor& indices);
// y[.., indices[.., i]] += x[.., i], in the order of i; y's last axis has `extent` elements.
Var PlaceAlong(const Var& x, const Tensor& indices, std::int64_t extent);

}  // namespace tilegrad::nn
