// SPDX-License-Identifier: Apache-2.0
#include "train/metrics/set_scores.h"

#include <algorithm>

#include "train/metrics/frechet.h"

namespace tilegrad::train {
namespace {

Result<SetScore> ScoreOf(const FeatureRows& truth, const FeatureRows& other,
                         const Workers& workers) {
  SetScore out;
  TILEGRAD_ASSIGN(out.frechet, FrechetDistance(truth, other));
  const FeatureRows a = Standardised(truth, truth), b = Standardised(other, truth);
  TILEGRAD_ASSIGN(out.kernel, KernelDistance(a, b, workers));
  TILEGRAD_ASSIGN(out.coverage, PrecisionRecall(a, b, workers));
  return out;
}

}  // namespace

Result<SetScores> ScoreSets(const FeatureRows& truth, const FeatureRows& generated,
                            std::uint64_t seed, const Workers& workers) {
  constexpr std::size_t kLeast = kNeighbours + 1;
  TILEGRAD_TRY(CheckRows(truth, 2 * kLeast, "scores of sets, truth"));
  TILEGRAD_TRY(CheckRows(generated, kLeast, "scores of sets, generated"));
  SetScores out;
  out.n = std::min(generated.rows(), truth.rows() / 2);
  const FeatureRows drawn = DrawRows(truth, 2 * out.n, seed);
  const FeatureRows half = SliceRows(drawn, 0, out.n), other = SliceRows(drawn, out.n, 2 * out.n);
  TILEGRAD_ASSIGN(out.generated, ScoreOf(half, DrawRows(generated, out.n, seed + 1), workers));
  TILEGRAD_ASSIGN(out.floor, ScoreOf(half, other, workers));
  return out;
}

}  // namespace tilegrad::train
