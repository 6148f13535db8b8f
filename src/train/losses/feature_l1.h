// SPDX-License-Identifier: Apache-2.0
// Equation 16: images compared by what the layers of a network make of them,
//
//   L = mean over images of sum over layers i of |F^i(I) - F^i(I')|_1 / N_i,
//
// N_i the elements of layer i. With a network trained beforehand it is the perceptual loss, the
// equation's first sum; with the critic that is being trained it is discriminator feature matching,
// its second sum.
#pragma once

#include <functional>
#include <vector>

#include "nn/gan.h"
#include "nn/tape.h"

namespace tilegrad::train {

// images [n, 3, h, w], RGB over black in [0, 1] -> the output of each layer, [n, ..]. Perceptual
// networks come from LoadPerceptualNetwork (tasks/classify/perceptual_network.h).
using FeatureFunction = std::function<std::vector<nn::Var>(const nn::Var& images)>;

// `predicted` and `truth` are of one shape. A scalar with a gradient with respect to `predicted`;
// the features of the truth are constants. An optimiser of what made `predicted` leaves the
// network's own weights alone, as it does not ask for their gradients.
nn::Var FeatureL1Loss(const FeatureFunction& features, const nn::Var& predicted,
                      const nn::Tensor& truth);

// The levels of a critic without its scores, which the adversarial loss is about. The critic must
// outlive the function.
FeatureFunction FeaturesOf(nn::Critic& critic);

}  // namespace tilegrad::train
