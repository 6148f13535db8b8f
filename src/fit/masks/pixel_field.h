// SPDX-License-Identifier: Apache-2.0
// Labels of pixels that agree with their neighbours, but for where the picture has an edge: the
// mean field of an Ising model whose couplings fall with the difference of colours (Y. Boykov,
// M.-P. Jolly: Interactive graph cuts, ICCV 2001).
#pragma once

#include <span>
#include <vector>

namespace tilegrad::train {

class PixelField {
 public:
  // `color` [3,H,W]. Eight neighbours couple by exp(-d^2 / 2 s^2) over their distance, where s^2 is
  // the mean d^2 of the picture, at least that of its noise.
  PixelField(std::span<const float> color, int width, int height);

  struct Relaxing {
    int rounds = 40;
    float coupling = 1;  // of like neighbours at the end; it grows from 0
  };
  // `odds` [H,W], ln: of each pixel by itself. Returns in [0, 1] how far it belongs inside.
  std::vector<float> Relax(std::span<const float> odds, const Relaxing& how) const;

 private:
  std::size_t At(int x, int y) const;  // of planes with a border of one pixel

  int width_, height_;
  std::size_t stride_;
  std::vector<float> right_, below_, below_right_, below_left_;  // couplings, 0 across the border
};

}  // namespace tilegrad::train
