// SPDX-License-Identifier: Apache-2.0
// The network of sections 5.2 and 5.3: one RGBA image in; a deformed sphere, its texture map and
// the light out. The paper's figure 3 shows its three heads; sizes are ours where it has none.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "scene/mesh.h"
#include "tilegrad/scene.h"
#include "train/models/face_cubes.h"
#include "train/models/picture_code.h"
#include "train/models/prediction.h"
#include "train/models/texture_painter.h"

namespace tilegrad::train {

struct TextureNetworkConfig {
  std::int64_t base = 24;          // U-Net: channels of the first level; they double to at most
  std::int64_t most = 256;         // this many
  std::int64_t levels = 4;         // halvings
  std::int64_t enlarge = 1;        // the texture is 2^this times as large as the image
  bool skips = true;               // the U-Net's skip connections
  std::int64_t latent = 384;       // all heads start from this code, fully connected
  std::int64_t hidden = 512;       // width of the head of vertices
  std::int64_t light_width = 128;  // of the six layers of the head of light
  SphereConfig sphere = {};
  bool normalize = true;           // shapes get the truth's size and place, else they are learned
  bool symmetric_texture = false;  // the texture is its mirror image at x = 0
  // Texels are looked up in the picture through the predicted shape and camera, in addition to the
  // decoder's texels (picture_lookup.h).
  bool lookup = false;
  bool cubes = false;  // in evaluation textures are as N3MR's cubes show them (face_cubes.h)
  std::int64_t lookup_width = 16;   // channels of the decoder and of the layers behind it, then
  std::int64_t palette = 0;         // paints of an object (PaletteColors), with `lookup`; 0: none
  double output_deviation = 0.001;  // the head of vertices starts as N(0, this^2)
};

// The light that the network predicts, and its range.
struct LightHeadShape {
  Lighting lighting = Lighting::kLambert;
  double shininess_low = 3, shininess_high = 30;
  // Directions are of the hemisphere that faces the camera. From behind, an object is dark, and a
  // light that has got there would find no gradient that leads back.
  bool facing = true;
};

class TextureNetwork {
 public:
  // `image_size` in pixels, a multiple of 2^levels (CheckImageSize). The seed decides every weight.
  TextureNetwork(nn::Context& context, const TextureNetworkConfig& config,
                 const LightHeadShape& light, int image_size, std::uint64_t seed);

  // images: [B, 4, size, size], RGBA in [0, 1], RGB over black. Movement, positions (with
  // `normalize` box centred, largest half-extent SphereConfig::half_extent), textures, light, and
  // with `lookup` the pose.
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
  // The parts, shown to visitors as one module.
  struct Parts : nn::Module {
    std::optional<PictureCode> code;
    nn::Sequential shape, light, pose;
    std::optional<TexturePainter> paint;  // with `lookup`
    nn::Var Forward(const nn::Var& x, nn::Mode mode) override { return code->Forward(x, mode); }
    void Visit(const std::string& prefix, nn::ModuleVisitor& visitor) override;
  } all_;
};

// InvalidArgument says which key does not go with images of that size.
Status CheckImageSize(const TextureNetworkConfig& config, int image_size);

}  // namespace tilegrad::train
