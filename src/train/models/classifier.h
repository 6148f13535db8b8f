// SPDX-License-Identifier: Apache-2.0
// A small convolutional classifier of pictures, whose levels serve perceptual losses (equation 16)
// where no pretrained network is available.
#pragma once

#include <vector>

#include "nn/layers.h"

namespace tilegrad::train {

// `levels` times: 3x3 convolution, batch norm, ReLU, with 2x2 average pooling between them; then
// global average pooling and one linear layer. The channels double from `channels` up to `most`.
struct ClassifierConfig {
  std::int64_t channels = 24, most = 128, levels = 5;
};

class ClassifierNetwork : public nn::Module {
 public:
  // `classes` at least 2. The seed determines every weight.
  ClassifierNetwork(nn::Context& context, const ClassifierConfig& config, std::int64_t classes,
                    std::uint64_t seed);

  // images [n, 3, h, w], RGB over black in [0, 1], h and w at least 2^(levels - 1) -> scores of the
  // classes before the softmax, [n, classes].
  nn::Var Forward(const nn::Var& images, nn::Mode mode) override;
  // The output of every level before its ReLU, [n, c, h / 2^i, w / 2^i] for level i from 0: after
  // the ReLU, maps carry no information where they are 0, and compare pictures worse.
  std::vector<nn::Var> Levels(const nn::Var& images, nn::Mode mode);
  void Visit(const std::string& prefix, nn::ModuleVisitor& visitor) override;

 private:
  std::vector<nn::Sequential> levels_;  // convolution and norm
  nn::Sequential head_;
};

}  // namespace tilegrad::train
