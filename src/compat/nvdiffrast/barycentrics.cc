// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/barycentrics.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "compat/nvdiffrast/barycentrics.cc"
#include <hwy/foreach_target.h>

#include "compat/nvdiffrast/barycentrics-inl.h"

#if HWY_ONCE

namespace tilegrad::compat::nvdiffrast {
HWY_EXPORT(WriteRow);
HWY_EXPORT(PullBand);

PixelCentres::PixelCentres(const PixelGrid& grid)
    : x(grid.row() + kPadding), y(static_cast<std::size_t>(grid.height)) {
  for (int i = 0; i < grid.width; ++i) x[static_cast<std::size_t>(i)] = CentreOf(grid, i, 0).x;
  for (int i = 0; i < grid.height; ++i) y[static_cast<std::size_t>(i)] = CentreOf(grid, 0, i).y;
}

void WriteBarycentrics(const RasterizeInput<float>& input, const PixelCentres& centres,
                       const BinRow& row, const RasterizeOutput<float>& out) {
  HWY_DYNAMIC_DISPATCH(WriteRow)(input, centres, row, out);
}

std::size_t PullBarycentrics(const RasterizeInput<float>& input, const PixelCentres& centres,
                             const RasterizeCotangents<float>& cotangents, const Band& band,
                             BandSums::Adder* adder) {
  return HWY_DYNAMIC_DISPATCH(PullBand)(input, centres, cotangents, band, adder);
}

}  // namespace tilegrad::compat::nvdiffrast
#endif
