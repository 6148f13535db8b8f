// SPDX-License-Identifier: Apache-2.0
// The generator of section 5.5: normally distributed noise in, the vertices of a deformed sphere
// and its texture map out. The paper gives no sizes; these are ours.
#pragma once

#include <array>
#include <cstdint>

#include "nn/layers.h"
#include "scene/mesh.h"
#include "train/models/sphere_model.h"

namespace tilegrad::train {

struct GeneratorConfig {
  std::int64_t noise = 64;        // dimension of a code; textures depend on all of it,
  std::int64_t shape_noise = 32;  // shapes on this first part: one shape has many liveries
  std::int64_t hidden = 256;      // widths of the two layers before the vertices
  SphereConfig sphere = {.radius = 0.2};
  double output_deviation = 0.01;   // initial weights of the vertex head are N(0, this^2)
  std::int64_t texture_size = 128;  // texels a side, 8 times a power of two
  std::int64_t texture_base = 16;   // channels at full size, double with each halving up to
  std::int64_t texture_most = 128;  // this many
  bool symmetric_texture = true;    // textures are symmetric at x = 0
};

// InvalidArgument names the key with an invalid value.
Status CheckGenerator(const GeneratorConfig& config);

class ShapeTextureGenerator {
 public:
  // CheckGenerator(config) is ok. The seed determines every weight.
  ShapeTextureGenerator(nn::Context& context, const GeneratorConfig& config, std::uint64_t seed);

  // noise: [B, noise]. The offsets, and the ellipsoid moved by them.
  Prediction MakeShapes(const nn::Var& noise, nn::Mode mode);
  // [B, 3, texture_size, map_width()] in [0, 1], by the sphere's longitude and latitude: the
  // learned part of a map, with `symmetric_texture` the half around u = 1/2, where x > 0.
  nn::Var MakeMaps(const nn::Var& noise, nn::Mode mode);
  nn::Var MeanMaps(std::int64_t count) const;  // `count` copies of SetMeanMap's
  // Maps as textures [B, texture_size, texture_size, 3].
  nn::Var Textures(const nn::Var& maps) const;

  nn::Module& shape() { return shape_; }
  nn::Module& texture() { return texture_; }
  // Shapes start as the ellipsoid with these half axes, world units, x y z; as the sphere if none
  // are set. A start that fills true silhouettes can take their shape without folding.
  void SetEllipsoid(const std::array<double, 3>& half_axes);
  // The initial map of textures, [3, texture_size, map_width()] in [0, 1]; grey if none is set.
  void SetMeanMap(std::span<const float> map);

  const GeneratorConfig& config() const { return config_; }
  std::int64_t map_width() const { return MapWidth(config_); }
  static std::int64_t MapWidth(const GeneratorConfig& config) {
    return config.symmetric_texture ? config.texture_size / 2 : config.texture_size;
  }
  // The first column of a texture that is in a map.
  static std::int64_t FirstColumn(const GeneratorConfig& config) {
    return config.symmetric_texture ? config.texture_size / 4 : 0;
  }
  const SphereModel& sphere() const { return sphere_; }

 private:
  struct ShapeNet : nn::Module {
    nn::Sequential net;
    nn::Tensor scale;  // [3], of the sphere
    nn::Var Forward(const nn::Var& noise, nn::Mode mode) override {
      return net.Forward(noise, mode);
    }
    void Visit(const std::string& prefix, nn::ModuleVisitor& visitor) override;
  };
  struct TextureNet : nn::Module {
    nn::Sequential net;
    nn::Tensor mean;  // logits, [1, 3, h, w]
    nn::Var Forward(const nn::Var& noise, nn::Mode mode) override;
    void Visit(const std::string& prefix, nn::ModuleVisitor& visitor) override;
    nn::Shape root;  // of one sample, after the first layer
    nn::Sequential first;
  };
  void BuildShape(Rng& rng);
  void BuildTexture(Rng& rng);

  nn::Context& context_;
  GeneratorConfig config_;
  SphereModel sphere_;
  nn::Tensor columns_;  // the map's column for each column of a texture
  ShapeNet shape_;
  TextureNet texture_;
};

}  // namespace tilegrad::train
