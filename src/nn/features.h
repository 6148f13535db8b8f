// SPDX-License-Identifier: Apache-2.0
// The convolutional part of VGG16, with weights supplied by the user, to compare images by their
// features (Johnson et al. 2016; Zhang et al. 2018 say which layers).
#pragma once

#include <span>
#include <vector>

#include "nn/tape.h"
#include "nn/tensor.h"

namespace tilegrad::nn {

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
