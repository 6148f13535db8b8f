// SPDX-License-Identifier: Apache-2.0
// What the networks of sections 5.2 to 5.4 have in common: a U-Net from a picture to a map of the
// sphere, whose bottom goes through one code that other heads start from, too.
#pragma once

#include "nn/unet.h"

namespace tilegrad::train {

struct PictureCodeShape {
  std::int64_t image_size = 64;  // pixels a side, a multiple of 2^levels of the U-Net
  std::int64_t latent = 384;     // numbers of the code
  int layers = 1;                // fully connected, from the U-Net's bottom to the code
};

class PictureCode : public nn::Module {
 public:
  PictureCode(nn::Context& context, const nn::UNetShape& unet, const PictureCodeShape& shape,
              Rng& rng);

  struct Encoded {
    nn::StepVector<nn::Var> levels;  // UNet::Encode
    nn::Var latent;                  // [B, latent]
  };
  Encoded Encode(const nn::Var& pictures, nn::Mode mode);    // [B, in, size, size]
  nn::Var DecodeMap(const Encoded& encoded, nn::Mode mode);  // [B, out, h, w]

  nn::Var Forward(const nn::Var& pictures, nn::Mode mode) override {
    return DecodeMap(Encode(pictures, mode), mode);
  }
  void Visit(const std::string& prefix, nn::ModuleVisitor& visitor) override;

 private:
  nn::UNet unet_;
  nn::Sequential latent_, map_;
  nn::Shape bottom_;  // of the U-Net, for one picture
};

// Rows of v [B, n], each divided by sqrt(|v|^2 + 1e-8), so that a row of zeros stays one.
nn::Var UnitRows(const nn::Var& v);

}  // namespace tilegrad::train
