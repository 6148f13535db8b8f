// SPDX-License-Identifier: Apache-2.0
// What a texture holds, carried from one surface to another with other charts.
#pragma once

#include <span>
#include <vector>

#include "base/aligned.h"
#include "base/parallel.h"
#include "fit/scene.h"

namespace tilegrad::train {

// `arrays`: of 3 numbers for each texel of both scenes' textures, which must have one size:
// colours, an optimiser's moments. Each texel on a chart of `to` takes what `from` has, bilinearly,
// at the point of its surface that is nearest. Returns which texels those are, [H W]; the others
// get 0. Any number of workers gives the same bits.
std::vector<bool> TransferTexels(const FitScene& from, const FitScene& to, const Workers& workers,
                                 std::span<AlignedVector<float>* const> arrays);

}  // namespace tilegrad::train
