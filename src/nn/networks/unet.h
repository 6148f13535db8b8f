// SPDX-License-Identifier: Apache-2.0
// U-Net (Ronneberger et al. 2015) in the form of pix2pix (Isola et al. 2017): halving convolutions
// down to a code, doubling ones back up, each of which also sees what the way down had at its size.
#pragma once

#include <vector>

#include "nn/networks/blocks.h"

namespace tilegrad::nn {

struct UNetShape {
  std::int64_t in = 3, out = 3;  // channels of the images
  std::int64_t base = 64;        // channels after the first level; they double to at most
  std::int64_t most = 512;       // this many
  int levels = 8;                // halvings: an image's sides are multiples of 2^levels
  Norm norm = Norm::kInstance;   // not of the first level, nor of one that is down to one pixel
  bool resize = false;           // the way up: nearest resizing and a 3x3 convolution, not a 4x4
                                 // transposed one: costs more and leaves no checkerboard
  Activation::Function output = nullptr;  // e.g. &Sigmoid
};

class UNet : public Module {
 public:
  UNet(Context& context, const UNetShape& shape, Rng& rng);

  struct Result {
    Var image;  // [n, out, h, w]
    Var code;   // [n, c, h / 2^levels, w / 2^levels]: what other heads start from
  };
  Result Run(const Var& x, Mode mode);  // x [n, in, h, w]
  Var Forward(const Var& x, Mode mode) override { return Run(x, mode).image; }
  void Visit(const std::string& prefix, ModuleVisitor& visitor) override;

 private:
  std::vector<Sequential> down_, up_;  // up_[i] undoes down_[i]
};

}  // namespace tilegrad::nn
