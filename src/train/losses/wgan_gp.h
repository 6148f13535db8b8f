// SPDX-License-Identifier: Apache-2.0
// Equation 15 and its part of equation 17: the Wasserstein game with gradient penalty (Arjovsky et
// al. 2017, Gulrajani et al. 2017).
//
//   W    = E[D(I)] - E[D(I')]                       how far the critic D tells real from rendered
//   L_gp = E[(|grad_x D(x)|_2 - 1)^2]               one norm per sample
//   the critic minimises     -W + lambda_gp L_gp
//   the generator minimises  -E[D(I')]              the part of W that depends on it
//
// Equation 17 as printed has the critic maximise W + lambda_gp L_gp, which would reward gradients
// whose norm is far from 1; here the penalty is subtracted, as in the work that it cites. D of an
// image is the mean of its score map.
#pragma once

#include <string>

#include "base/rng.h"
#include "nn/layers.h"
#include "tilegrad/status.h"

namespace tilegrad::train {

// Where the penalty's x lies.
enum class PenaltyPlace {
  kRendered,     // at the rendered image I', as equation 15 is printed
  kInterpolates  // at t I + (1 - t) I', t uniform in [0, 1) for each sample (Gulrajani et al.)
};
// "rendered" or "interpolates", as configurations spell it; InvalidArgument lists them.
Result<PenaltyPlace> PenaltyPlaceOf(const std::string& word);

struct WganGpOptions {
  double penalty = 0.5;  // lambda_gp: 0.5 in section 5.3, 10 in Gulrajani et al.; 0: none
  PenaltyPlace place = PenaltyPlace::kRendered;
};

// Scalars. `penalty` is unweighted, and invalid where its weight is 0.
struct CriticLoss {
  nn::Var total, wasserstein, penalty;
};

// The critic's objective, to minimise. real, fake: [n, ..] of one shape, detached: a critic's
// update moves only the critic. The critic must have no batch norm: a sample's score must depend on
// that sample alone. Draws from `rng` only for interpolates.
CriticLoss WganCriticLoss(nn::Module& critic, const nn::Var& real, const nn::Var& fake,
                          const WganGpOptions& options, Rng& rng);

// The generator's objective, -E[D(fake)]: differentiable with respect to whatever made `fake`, also
// through the renderer.
nn::Var WganGeneratorLoss(nn::Module& critic, const nn::Var& fake);

}  // namespace tilegrad::train
