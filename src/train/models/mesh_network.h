// SPDX-License-Identifier: Apache-2.0
// The network of section 5.1: one RGBA image in, a deformed and coloured sphere out.
#pragma once

#include "nn/layers.h"
#include "train/models/sphere_model.h"

namespace tilegrad::train {

// The network of section 5.1; the defaults are the paper's, 34,115,916 parameters at 64
// x 64 with the 642-vertex template.
struct NetworkConfig {
  std::int64_t channels = 64;   // of the first convolution; the next two have 2x and 4x
  std::int64_t code = 1024;     // width of the encoder's three fully connected layers
  std::int64_t hidden1 = 1024;  // widths of each decoder
  std::int64_t hidden2 = 2048;
  SphereConfig sphere = {.radius = 0.175, .smoothing = 0, .symmetric = false};
  bool fc_norm = true;              // batch norm after hidden fully connected layers
  double output_deviation = 0.001;  // the decoders' initial last weights are N(0, this^2): the
                                    // first prediction is nearly the template
  double fc_deviation = 0.001;  // initial fully connected weights are N(0, this^2); 0: uniform by
                                // fan-in, as for convolutions
  double color_bias = 0.0;      // initial vertex colours
  bool picture_colors = false;  // samples colours from the picture (nn/ops.h)
};

// At 64 x 64 with NetworkConfig's defaults.
inline constexpr std::int64_t kPaperParameters = 34'115'916;

class MeshNetwork {
 public:
  // `image_size` in pixels, a multiple of 8. The seed determines every weight.
  MeshNetwork(nn::Context& context, const NetworkConfig& config, int image_size,
              std::uint64_t seed);

  // images: [B, 4, size, size], RGBA in [0, 1], RGB over black. Returns movement, colours, and
  // positions with a centred bounding box of largest half-extent SphereConfig::half_extent.
  Prediction Forward(const nn::Var& images, nn::Mode mode);

  nn::Module& module() { return all_; }
  const SphereModel& sphere() const { return sphere_; }

 private:
  nn::Var Colors(const nn::Var& code, const nn::Var& images, nn::Mode mode);

  NetworkConfig config_;
  SphereModel sphere_;
  // The three parts as one module for visitors.
  struct Parts : nn::Module {
    nn::Sequential encoder, shape, color;
    nn::Var Forward(const nn::Var& x, nn::Mode mode) override { return encoder.Forward(x, mode); }
    void Visit(const std::string& prefix, nn::ModuleVisitor& visitor) override;
  } all_;
};

}  // namespace tilegrad::train
