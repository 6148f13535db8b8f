// SPDX-License-Identifier: Apache-2.0
#include "train/losses/feature_l1.h"

#include "base/error.h"
#include "nn/features.h"

namespace tilegrad::train {
namespace {

std::vector<nn::Var> ConstantFeatures(const FeatureFunction& features, nn::Context& context,
                                      const nn::Tensor& images) {
  const nn::NoGrad off(context);
  return features(nn::Constant(context, images));
}

}  // namespace

nn::Var FeatureL1Loss(const FeatureFunction& features, const nn::Var& predicted,
                      const nn::Tensor& truth) {
  if (!predicted.valid()) return predicted;
  if (!(predicted.shape() == truth.shape()) || predicted.dtype() != truth.dtype()) {
    return nn::Fail(predicted,
                    InternalError("feature loss: predicted {} and truth {} must be equal in shape "
                                  "and dtype",
                                  predicted.shape().ToString(), truth.shape().ToString()));
  }
  const std::vector<nn::Var> want = ConstantFeatures(features, predicted.context(), truth);
  const std::vector<nn::Var> have = features(predicted);
  if (have.empty())
    return nn::Fail(predicted, InvalidArgument("feature loss: the network gives no layers"));
  return nn::PerceptualL1(have, want);
}

FeatureFunction FeaturesOf(nn::Critic& critic) {
  return [&critic](const nn::Var& images) {
    std::vector<nn::Var> levels = critic.Features(images, nn::Mode::kTrain);
    levels.pop_back();
    return levels;
  };
}

}  // namespace tilegrad::train
