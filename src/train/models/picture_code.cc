// SPDX-License-Identifier: Apache-2.0
#include "train/models/picture_code.h"

#include "nn/nn.h"

namespace tilegrad::train {

PictureCode::PictureCode(nn::Context& context, const nn::UNetShape& unet,
                         const PictureCodeShape& shape, Rng& rng)
    : unet_(context, unet, rng) {
  const std::int64_t side = shape.image_size >> unet.levels;
  bottom_ = {std::min(unet.most, unet.base << (unet.levels - 1)), side, side};
  latent_.Add<nn::Flatten>("flatten");
  latent_.Add<nn::Activation>("act", &nn::LeakyRelu02);
  for (int i = 1; i <= shape.layers; ++i) {
    const std::string number = shape.layers == 1 ? "" : std::to_string(i);
    nn::AddLinear(latent_, "fc" + number, context, i == 1 ? bottom_.elements() : shape.latent,
                  shape.latent, rng);
    latent_.Add<nn::Activation>("act" + std::to_string(i), &nn::LeakyRelu02);
  }
  nn::AddLinear(map_, "fc", context, shape.latent, bottom_.elements(), rng);
}

PictureCode::Encoded PictureCode::Encode(const nn::Var& pictures, nn::Mode mode) {
  Encoded out{.levels = unet_.Encode(pictures, mode), .latent = {}};
  out.latent = latent_.Forward(out.levels.back(), mode);
  return out;
}

nn::Var PictureCode::DecodeMap(const Encoded& encoded, nn::Mode mode) {
  const nn::Var code = nn::Reshape(map_.Forward(encoded.latent, mode),
                                   {encoded.latent.shape()[0], bottom_[0], bottom_[1], bottom_[2]});
  return unet_.Decode(code, encoded.levels, mode);
}

void PictureCode::Visit(const std::string& prefix, nn::ModuleVisitor& visitor) {
  unet_.Visit(prefix + "unet.", visitor);
  latent_.Visit(prefix + "latent.", visitor);
  map_.Visit(prefix + "map.", visitor);
}

nn::Var UnitRows(const nn::Var& v) {
  return v / nn::Sqrt(nn::Sum(nn::Square(v), {1}, nn::Keep::kYes) + 1e-8);
}

}  // namespace tilegrad::train
