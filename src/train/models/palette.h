// SPDX-License-Identifier: Apache-2.0
// Colours of what a picture does not show, or shows in the dark: most of an object is of a few
// paints, and what is lit tells the colour of each.
#pragma once

#include "nn/tape.h"

namespace tilegrad::train {

// Each texel is of some paint, in shares `kinds` [M, K, h, w] that sum to 1 over K. The colour of a
// paint is the mean of what `seen` (PictureLookup::Look, [M, 12, h, w]) shows of it without the
// predicted light, where it is covered, faces the camera and is lit; where nothing is, that of
// `guess` [M, 3, h, w]. Returns the colours of all texels, [M, 3, h, w]; gradients go to `kinds`
// and `guess`.
nn::Var PaletteColors(const nn::Var& kinds, const nn::Tensor& seen, const nn::Var& guess);

}  // namespace tilegrad::train
