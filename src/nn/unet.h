// SPDX-License-Identifier: Apache-2.0
// U-Nets: an encoder down to a code and a decoder with skip connections from each level.
#pragma once

#include <vector>

#include "nn/layers.h"

namespace tilegrad::nn {

// Down as in pix2pix (Isola et al. 2017), a 4x4 convolution of stride 2 to each level; up by
// nearest resizing and a 3x3 convolution, which leaves no checkerboard. What comes out is a map
// around a body: its left and right edges are neighbours, and what lies beyond its upper and lower
// edges is what lies at them.
struct UNetShape {
  std::int64_t in = 3, out = 3;  // channels of the images
  std::int64_t base = 64;        // channels after the first level; they double to at most
  std::int64_t most = 512;       // this many
  int levels = 8;                // halvings: an image's sides are multiples of 2^levels
  bool skips = true;             // false: the decoder sees the code alone
  int enlarge = 0;               // further doublings behind the last level, of `base` channels
  Activation::Function output = nullptr;  // e.g. &Sigmoid
};

// Whether images of this side can be halved that often, to at least two pixels.
inline bool CanHalve(std::int64_t side, std::int64_t levels) {
  const std::int64_t step = std::int64_t{1} << levels;
  return side % step == 0 && side >= 2 * step;
}

class UNet : public Module {
 public:
  UNet(Context& context, const UNetShape& shape, Rng& rng);

  // Its two halves, for what stands between them. Levels: x, then each level's; the last is the
  // code. `code` has the shape of that one.
  StepVector<Var> Encode(const Var& x, Mode mode);
  Var Decode(const Var& code, const StepVector<Var>& levels, Mode mode);
  // x [n, in, h, w] -> [n, out, h, w] times 2^enlarge
  Var Forward(const Var& x, Mode mode) override;
  void Visit(const std::string& prefix, ModuleVisitor& visitor) override;

 private:
  std::vector<Sequential> down_, up_;  // up_[i] undoes down_[i]
  std::vector<Sequential> grow_;       // behind up_[0]
  bool skips_;
};

}  // namespace tilegrad::nn
