// SPDX-License-Identifier: Apache-2.0
// Networks that several tasks use: U-Nets, critics, and VGG16 for comparisons of images.
#pragma once

#include <span>
#include <vector>

#include "nn/layers.h"
#include "nn/tape.h"
#include "nn/tensor.h"

namespace tilegrad::nn {

// U-Nets: an encoder down to a code and a decoder with skip connections from each level.
//
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

// A critic of images, and what it is trained by.

// PatchGAN (Isola et al. 2017): `halvings` 4x4 convolutions of stride 2, leaky ReLU of 0.2 after
// each, the channels doubling from `base`, then a 3x3 one to one number for each patch. For the
// gradient penalty no batch norm: a sample's score must depend on that sample alone.
struct CriticShape {
  std::int64_t in = 3, base = 64;
  int halvings = 4;
  PadMode padding_mode = PadMode::kZero;  // kCircular for textures that wrap around
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
// (|d mean score / d x| - 1)^2, one norm for each sample (Gulrajani et al. 2017, the paper's
// equation 15). Both can be differentiated by the critic's weights, not by x.
struct PenalisedScore {
  Var score, penalty;  // scalars
};
PenalisedScore ScoreWithPenalty(Module& critic, const Var& x);
Var GradientPenalty(Module& critic, const Var& x);  // the second of the two

// The convolutional part of VGG16, with weights supplied by the user, to compare images by their
// features (Johnson et al. 2016; Zhang et al. 2018 say which layers).

class Vgg16 {
 public:
  // Weights by torchvision's names ("features.0.weight", "features.0.bias", ..), as ReadSafetensors
  // gives them; others are ignored. Channels are those of the tensors, so narrower networks of the
  // same build will do. An error names the tensor that is missing or does not fit what comes before
  // it.
  static Result<Vgg16> Load(Context& context, const std::vector<NamedTensor>& weights);

  // x [n, 3, h, w], RGB in [0, 1] (the means and deviations of ImageNet are applied here). Returns
  // the activations after the last rectifier of each of the five stages. The weights take no
  // gradient.
  std::vector<Var> Features(const Var& x) const;

 private:
  struct Convolution {
    Var weight, bias;
  };
  std::vector<Convolution> convolutions_;  // in the order of use
};

// sum over layers of mean |a - b|: the paper's equation 16. As many layers of both.
Var PerceptualL1(std::span<const Var> a, std::span<const Var> b);

}  // namespace tilegrad::nn
