// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "tilegrad/renderer.h"

namespace tilegrad::train {

// Image n of a square frame, samples x samples of its pixels to one of [4][size][size]: the mean of
// colours, cut to [0, 1], over black, and the covered share. Of a frame without colours unit means
// of normals, 0 where nothing is.
void AverageSamples(const Images& images, std::size_t n, int samples, std::span<float> to);

}  // namespace tilegrad::train
