// SPDX-License-Identifier: Apache-2.0
// CMR's regulariser of shapes: the mean over vertices of |L v|, with L by cotangents (Pinkall and
// Polthier, 1993):
//
//   (L v)_i = sum_j w_ij (v_j - v_i),   w_ij = (cot alpha + cot beta) / 2
//
// alpha and beta are the angles opposite the edge ij. As CMR's, weights are taken from the
// positions as they are and have no gradient themselves. Unlike its, they are taken anew in every
// step, and cotangents are cut at kMostCotangent, so that slivers stay finite.
#pragma once

#include <span>

#include "nn/tape.h"
#include "scene/mesh.h"

namespace tilegrad::train {

inline constexpr double kMostCotangent = 20;

// One mesh: adds L v of `v` [V,3], with weights of the positions `p` [V,3], to out [V,3].
template <class T>
void AddCotangentLaplacian(std::span<const Face> faces, std::span<const T> p, std::span<const T> v,
                           std::span<T> out);

// positions: [B, V, 3] of meshes that share `faces`. A scalar: the mean over the batch, too. The
// gradient is 0 where L v is.
nn::Var CotangentLaplacianLoss(const nn::Var& positions, std::span<const Face> faces);

}  // namespace tilegrad::train
