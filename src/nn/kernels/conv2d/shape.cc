// SPDX-License-Identifier: Apache-2.0
#include "base/error.h"
#include "nn/kernels/conv2d/conv2d.h"

namespace tilegrad::nn {

Status Conv2dShape::Check() const {
  if (in_channels == 0 || in_height == 0 || in_width == 0 || out_channels == 0 ||
      kernel_height == 0 || kernel_width == 0 || stride == 0) {
    return InvalidArgument(
        "conv2d of input [{},{},{},{}] with weights [{},{},{},{}] and stride {}: every extent must "
        "be positive",
        batch, in_channels, in_height, in_width, out_channels, in_channels, kernel_height,
        kernel_width, stride);
  }
  if (kernel_height > in_height + 2 * padding || kernel_width > in_width + 2 * padding) {
    return InvalidArgument("conv2d kernel {}x{} is larger than the image {}x{} padded by {}",
                           kernel_height, kernel_width, in_height, in_width, padding);
  }
  return {};
}

}  // namespace tilegrad::nn
