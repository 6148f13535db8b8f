// SPDX-License-Identifier: Apache-2.0
// Colours that vertices look up in a picture, for one picture at a time: nn/ops.h has the formula.
#pragma once

#include "nn/kernels/sample_colors_ref.h"

namespace tilegrad::nn {

// s.flow -> s.colors.
void SampleColors(const ColorCells<float>& cells, const ColorSpans<float>& s);
void SampleColors(const ColorCells<double>& cells, const ColorSpans<double>& s);
// s.flow, s.by_color -> s.by_flow: from the derivatives by colours to those by the flow.
void SampleColorsBackward(const ColorCells<float>& cells, const ColorSpans<float>& s);
void SampleColorsBackward(const ColorCells<double>& cells, const ColorSpans<double>& s);

}  // namespace tilegrad::nn
