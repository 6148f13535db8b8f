// SPDX-License-Identifier: Apache-2.0
// Networks shared by several tasks: U-Nets, critics, and VGG16 for comparing images.
#pragma once

#include <span>
#include <vector>

#include "nn/layers.h"
#include "nn/tape.h"
#include "nn/tensor.h"

namespace tilegrad::nn {

// U-Nets: an encoder down to a code and a decoder with skip connections from each level.
//
// Down as in pix2pix (Isola et al. 2017), a 4x4 convolution of stride 2 per level; up by nearest
// resizing and a 3x3 convolution, which avoids checkerboard artefacts. The output is a map around a
// body: padding is circular between left and right edges, and replicates the upper and lower ones.
struct UNetShape {
  std::int64_t in = 3, out = 3;  // channels of the images
  std::int64_t base = 64;        // channels after the first level; they double to at most
  std::int64_t most = 512;       // this many
  int levels = 8;                // halvings: image sides must be multiples of 2^levels
  bool skips = true;             // false: the decoder gets only the code
  int enlarge = 0;               // further doublings after the last level, with `base` channels
  Activation::Function output = nullptr;  // e.g. &Sigmoid
};

// Whether images of this side can be halved that many times, to at least two pixels.
inline bool CanHalve(std::int64_t side, std::int64_t levels) {
  const std::int64_t step = std::int64_t{1} << levels;
  return side % step == 0 && side >= 2 * step;
}

class UNet : public Module {
 public:
  UNet(Context& context, const UNetShape& shape, Rng& rng);

  // Encoder and decoder separately, to insert something between them. Levels: x, then each level's
  // output; the last is the code. `code` has the shape of the last.
  StepVector<Var> Encode(const Var& x, Mode mode);
  Var Decode(const Var& code, const StepVector<Var>& levels, Mode mode);
  // x [n, in, h, w] -> [n, out, h, w] times 2^enlarge
  Var Forward(const Var& x, Mode mode) override;
  void Visit(const std::string& prefix, ModuleVisitor& visitor) override;

 private:
  std::vector<Sequential> down_, up_;  // up_[i] undoes down_[i]
  std::vector<Sequential> grow_;       // after up_[0]
  bool skips_;
};

// A critic of images, and its training loss.

// PatchGAN (Isola et al. 2017): `halvings` 4x4 convolutions of stride 2, leaky ReLU of 0.2 after
// each, the channels doubling from `base`, then a 3x3 one to one number per patch. No batch norm,
// for the gradient penalty: a sample's score must depend on that sample alone.
struct CriticShape {
  std::int64_t in = 3, base = 64;
  int halvings = 4;
  PadMode padding_mode = PadMode::kZero;  // kCircular for wrap-around textures
};
class Critic : public Module {
 public:
  Critic(Context& context, const CriticShape& shape, Rng& rng);
  // The output of every level, for feature matching; the last is the map of scores [n, 1, h, w].
  std::vector<Var> Features(const Var& x, Mode mode);
  Var Forward(const Var& x, Mode mode) override;  // the map of scores
  void Visit(const std::string& prefix, ModuleVisitor& visitor) override;

 private:
  std::vector<Sequential> levels_;
};

// A critic at x [n, ..]: the mean over samples of its mean score, and the mean over samples of
// (|d mean score / d x| - 1)^2, one norm per sample (Gulrajani et al. 2017, the paper's equation
// 15). Both are differentiable by the critic's weights, not by x.
struct PenalisedScore {
  Var score, penalty;  // scalars
};
PenalisedScore ScoreWithPenalty(Module& critic, const Var& x);
Var GradientPenalty(Module& critic, const Var& x);  // PenalisedScore::penalty alone

// The convolutional part of VGG16, with weights supplied by the user, for comparing images by their
// features (Johnson et al. 2016; layers as in Zhang et al. 2018).

class Vgg16 {
 public:
  // Weights by torchvision's names ("features.0.weight", "features.0.bias", ..), as read by
  // ReadSafetensors; ignores others. Takes the number of channels from the tensors, so narrower
  // networks of the same architecture work. An error names the tensor that is missing or does not
  // match the previous layer.
  static Result<Vgg16> Load(Context& context, const std::vector<NamedTensor>& weights);

  // x [n, 3, h, w], RGB in [0, 1] (normalised here with ImageNet's means and deviations). Returns
  // the activations after the last rectifier of each of the five stages. The weights get no
  // gradient.
  std::vector<Var> Features(const Var& x) const;

 private:
  struct Convolution {
    Var weight, bias;
  };
  std::vector<Convolution> convolutions_;  // in the order of use
};

// sum over layers of mean |a - b|: the paper's equation 16. Both must have the same number of
// layers.
Var PerceptualL1(std::span<const Var> a, std::span<const Var> b);

}  // namespace tilegrad::nn
