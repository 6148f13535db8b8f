// SPDX-License-Identifier: Apache-2.0
// Texels mixed from what the input picture shows of them and what a network makes up.
#pragma once

#include "nn/nn.h"
#include "train/models/picture_lookup.h"

namespace tilegrad::train {

struct TexturePainterShape {
  int image_size = 64, texture_size = 128;  // pixels and texels a side
  std::int64_t width = 16;                  // channels of the maps that come in, and of the layers
  std::int64_t palette = 0;                 // paints of an object (PaletteColors); 0: none
};

class TexturePainter {
 public:
  TexturePainter(nn::Context& context, const Mesh& sphere, const TexturePainterShape& shape,
                 Rng& rng);

  // map: [B, width, image_size, image_size] -> textures [B, 3, texture_size, texture_size] in
  // [0, 1], but for a tenth of what is above 1. Gradients go to `map` and the layers.
  //
  // A mixture of colours: what the picture shows at the texel and at its mirror image, without the
  // predicted light and then brighter or darker; what the network makes up; that of the texel's
  // paint. Were the light left in it, textures would explain their own pictures best under no
  // light at all.
  nn::Var Paint(const nn::Var& map, const PictureLookup::Job& job, nn::Mode mode);
  // PictureLookup::Cues of the picture.
  nn::Tensor Cues(const PictureLookup::Job& job) const { return coarse_.Cues(context_, job); }

  void Visit(const std::string& prefix, nn::ModuleVisitor& visitor) {
    layers_.Visit(prefix, visitor);
  }

 private:
  // Shares of picture, mirror image, made-up colour and paint: [B, 3 or 4, h, w], their sum is 1.
  nn::Var Shares(const nn::Var& raw) const;
  // Colours that do not come from the texel's own place in the picture, times their shares.
  nn::Var MadeUp(const nn::Var& raw, const nn::Var& shares, const nn::Tensor& seen) const;

  nn::Context& context_;
  TexturePainterShape shape_;
  PictureLookup coarse_, fine_;  // of the picture's size, and of the texture's
  nn::Sequential layers_;
};

// Colours of what a picture does not show, or shows in the dark: most of an object is of a few
// paints, and its lit parts give the colour of each.
//
// Each texel is of some paint, in shares `kinds` [M, K, h, w] that sum to 1 over K. The colour of a
// paint is the mean of what `seen` (PictureLookup::Look, [M, 12, h, w]) shows of it without the
// predicted light, where it is covered, faces the camera and is lit; where nothing is, that of
// `guess` [M, 3, h, w]. Returns the colours of all texels, [M, 3, h, w]; gradients go to `kinds`
// and `guess`.
nn::Var PaletteColors(const nn::Var& kinds, const nn::Tensor& seen, const nn::Var& guess);

}  // namespace tilegrad::train
