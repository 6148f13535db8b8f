// SPDX-License-Identifier: Apache-2.0
// The network of sections 5.2 and 5.3: one RGBA image in; a deformed sphere, its texture map and
// the light out. The paper's figure 3 shows its three heads; sizes that it does not give are ours.
#pragma once

#include <optional>
#include <string>

#include "nn/nn.h"
#include "scene/mesh.h"
#include "tilegrad/scene.h"
#include "train/models/picture_lookup.h"
#include "train/models/sphere_model.h"

namespace tilegrad::train {

// Mixes texels from what the input picture shows of them and from colours that a network makes up.

struct TexturePainterShape {
  int image_size = 64, texture_size = 128;  // pixels and texels a side
  std::int64_t width = 16;                  // channels of the input maps and of the layers
  std::int64_t palette = 0;                 // paints of an object (PaletteColors); 0: none
};

class TexturePainter {
 public:
  TexturePainter(nn::Context& context, const Mesh& sphere, const TexturePainterShape& shape,
                 Rng& rng);

  // map: [B, width, image_size, image_size] -> textures [B, 3, texture_size, texture_size] in [0,
  // 1], except that a tenth of any excess above 1 remains. Gradients go to `map` and the layers.
  //
  // A mixture of colours: the picture's at the texel and at its mirror image, with the predicted
  // light divided out and a predicted gain; one that the network makes up; that of the texel's
  // paint. With the light left in, textures would explain their own pictures best without any
  // light.
  nn::Var Paint(const nn::Var& map, const PictureLookup::Job& job, nn::Mode mode);
  // PictureLookup::Cues of the picture.
  nn::Tensor Cues(const PictureLookup::Job& job) const { return coarse_.Cues(context_, job); }

  void Visit(const std::string& prefix, nn::ModuleVisitor& visitor) {
    layers_.Visit(prefix, visitor);
  }

 private:
  // Shares of picture, mirror image, made-up colour and paint: [B, 3 or 4, h, w], with sum 1.
  nn::Var Shares(const nn::Var& raw) const;
  // Colours that do not come from the texel's own place in the picture, times their shares.
  nn::Var MadeUp(const nn::Var& raw, const nn::Var& shares, const nn::Tensor& seen) const;

  nn::Context& context_;
  TexturePainterShape shape_;
  PictureLookup coarse_, fine_;  // of the picture's size and of the texture's
  nn::Sequential layers_;
};

// Colours of texels that a picture hides or shows unlit: most objects have a few paints, and their
// lit parts give the colour of each.
//
// `kinds` [M, K, h, w] assigns each texel to paints, with shares that sum to 1 over K. The colour
// of a paint is its mean in `seen` (PictureLookup::Look, [M, 12, h, w]) with the predicted light
// divided out, over texels that are covered, face the camera and are lit; without such texels it is
// that in `guess` [M, 3, h, w]. Returns the colours of all texels, [M, 3, h, w]; gradients go to
// `kinds` and `guess`.
nn::Var PaletteColors(const nn::Var& kinds, const nn::Tensor& seen, const nn::Var& guess);

struct TextureNetworkConfig {
  PictureCodeConfig code = {};
  std::int64_t hidden = 512;       // width of the vertex head
  std::int64_t light_width = 128;  // of the six layers of the light head
  SphereConfig sphere = {};
  bool normalize = true;           // shapes get the truth's size and place; else these are learned
  bool symmetric_texture = false;  // the texture is symmetric at x = 0
  // Samples texels from the picture through the predicted shape and camera, in addition to the
  // decoder's texels (picture_lookup.h).
  bool lookup = false;
  bool cubes = false;  // in eval mode textures pass through N3MR's cubes (picture_lookup.h)
  std::int64_t lookup_width = 16;  // with `lookup`: channels of the decoder and the layers after it
  std::int64_t palette = 0;        // paints of an object (PaletteColors), with `lookup`; 0: none
  double output_deviation = 0.001;  // initial weights of the vertex head are N(0, this^2)
};

// The light that the network predicts, and its range.
struct LightHeadShape {
  Lighting lighting = Lighting::kLambert;
  double shininess_low = 3, shininess_high = 30;
  // Restricts directions to the hemisphere that faces the camera. Lit from behind, an object is
  // dark, so a light that gets there has no gradient to bring it back.
  bool facing = true;
};

class TextureNetwork {
 public:
  // `image_size` in pixels, a multiple of 2^levels (CheckImageSize). The seed determines every
  // weight.
  TextureNetwork(nn::Context& context, const TextureNetworkConfig& config,
                 const LightHeadShape& light, int image_size, std::uint64_t seed);

  // images: [B, 4, size, size], RGBA in [0, 1], RGB over black. Returns movement, positions (with
  // `normalize` a centred box of largest half-extent SphereConfig::half_extent), textures, light,
  // and with `lookup` the pose.
  Prediction Forward(const nn::Var& images, nn::Mode mode);

  nn::Module& module() { return all_; }
  const SphereModel& sphere() const { return sphere_; }
  const FaceCubes& cubes() const { return cubes_; }  // with TextureNetworkConfig::cubes

 private:
  void BuildHeads(Rng& rng);
  void BuildLookup(int image_size, Rng& rng);
  nn::Var Texture(const PictureCode::Encoded& encoded, const Prediction& objects, nn::Mode mode);
  void Light(const PictureCode::Encoded& encoded, nn::Mode mode, Prediction* out);

  nn::Context& context_;
  TextureNetworkConfig config_;
  LightHeadShape light_;
  int texture_size_;
  SphereModel sphere_;
  nn::AxisMap mirror_;  // of texel columns
  FaceCubes cubes_;
  // The parts as one module for visitors.
  struct Parts : nn::Module {
    std::optional<PictureCode> code;
    nn::Sequential shape, light, pose;
    std::optional<TexturePainter> paint;  // with `lookup`
    nn::Var Forward(const nn::Var& x, nn::Mode mode) override { return code->Forward(x, mode); }
    void Visit(const std::string& prefix, nn::ModuleVisitor& visitor) override;
  } all_;
};

// InvalidArgument names the key that does not fit images of that size.
Status CheckImageSize(const PictureCodeConfig& config, int image_size);

}  // namespace tilegrad::train
