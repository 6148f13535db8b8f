// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/sample_colors.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/kernels/sample_colors.cc"
#include <hwy/foreach_target.h>
//
#include "nn/kernels/sample_colors-inl.h"

#if HWY_ONCE
namespace tilegrad::nn {

HWY_EXPORT(SampleForward);
HWY_EXPORT(SampleBackward);

void SampleColors(const ColorCells<float>& cells, const ColorSpans<float>& s) {
  HWY_DYNAMIC_DISPATCH(SampleForward)(cells, s);
}
void SampleColors(const ColorCells<double>& cells, const ColorSpans<double>& s) {
  SampleForwardRef(cells, s);
}
void SampleColorsBackward(const ColorCells<float>& cells, const ColorSpans<float>& s) {
  HWY_DYNAMIC_DISPATCH(SampleBackward)(cells, s);
}
void SampleColorsBackward(const ColorCells<double>& cells, const ColorSpans<double>& s) {
  SampleBackwardRef(cells, s);
}

}  // namespace tilegrad::nn
#endif  // HWY_ONCE
