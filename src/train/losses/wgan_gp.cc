// SPDX-License-Identifier: Apache-2.0
#include "train/losses/wgan_gp.h"

#include "base/error.h"
#include "nn/networks.h"
#include "nn/ops.h"

namespace tilegrad::train {
namespace {

// One share for each sample, for broadcasting over [n, ..].
nn::Var SharesOf(const nn::Var& samples, Rng& rng) {
  nn::Shape shape;
  for (int axis = 0; axis < samples.shape().rank(); ++axis)
    shape.Append(axis == 0 ? samples.shape()[0] : 1);
  nn::Tensor shares = samples.context().Empty(shape, samples.dtype());
  nn::WithFloatType(shares.dtype(), [&]<class T>(T) {
    for (T& share : shares.span<T>()) share = static_cast<T>(rng.Uniform());
  });
  return nn::Constant(samples.context(), std::move(shares));
}

nn::Var Interpolated(const nn::Var& real, const nn::Var& fake, Rng& rng) {
  return nn::Detach(fake + SharesOf(fake, rng) * (real - fake));
}

nn::Var MeanScore(nn::Module& critic, const nn::Var& images) {
  return nn::Mean(critic.Forward(images, nn::Mode::kTrain));
}

}  // namespace

Result<PenaltyPlace> PenaltyPlaceOf(const std::string& word) {
  if (word == "rendered") return PenaltyPlace::kRendered;
  if (word == "interpolates") return PenaltyPlace::kInterpolates;
  return InvalidArgument(
      "the place of the gradient penalty is \"{}\", but must be \"rendered\" or \"interpolates\"",
      word);
}

CriticLoss WganCriticLoss(nn::Module& critic, const nn::Var& real, const nn::Var& fake,
                          const WganGpOptions& options, Rng& rng) {
  if (!real.valid() || !fake.valid()) return {nn::Invalid({&real, &fake}), {}, {}};
  if (!(real.shape() == fake.shape()) || fake.shape().rank() < 2) {
    const nn::Var failed =
        nn::Fail(fake, InternalError("critic: real {} and fake {} must be of one shape [n, ..]",
                                     real.shape().ToString(), fake.shape().ToString()));
    return {failed, failed, failed};
  }
  const nn::Var constant = nn::Detach(fake);
  nn::Var fake_score, penalty;
  if (options.penalty > 0 && options.place == PenaltyPlace::kRendered) {
    const nn::PenalisedScore at = nn::ScoreWithPenalty(critic, constant);
    fake_score = at.score;
    penalty = at.penalty;
  } else {
    fake_score = MeanScore(critic, constant);
    if (options.penalty > 0)
      penalty = nn::GradientPenalty(critic, Interpolated(nn::Detach(real), constant, rng));
  }
  const nn::Var wasserstein = MeanScore(critic, nn::Detach(real)) - fake_score;
  nn::Var total = -wasserstein;
  if (options.penalty > 0) total = total + options.penalty * penalty;
  return {total, wasserstein, penalty};
}

nn::Var WganGeneratorLoss(nn::Module& critic, const nn::Var& fake) {
  return -MeanScore(critic, fake);
}

}  // namespace tilegrad::train
