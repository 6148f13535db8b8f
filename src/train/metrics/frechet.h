// SPDX-License-Identifier: Apache-2.0
// How far two sets of pictures are from each other as a whole: distances of distributions of their
// features. Small sets are biased, so a figure means something beside one of equal size only: see
// set_scores.h. With features of any network but Inception v3 this is not "FID".
#pragma once

#include "train/metrics/feature_rows.h"

namespace tilegrad::train {

// Frechet distance of the normal distributions of two sets (Dowson, Landau 1982; Heusel et al.
// 2017): |m_a - m_b|^2 + tr(C_a + C_b - 2 (C_a C_b)^(1/2)), C the unbiased covariances. At least 2
// rows each. Of f32 features as good as sqrt of their rounding: 1e-6 of the traces.
Result<double> FrechetDistance(const FeatureRows& a, const FeatureRows& b);

// Kernel distance (Binkowski et al. 2018): the unbiased estimate of the squared maximum mean
// discrepancy with k(x, y) = (x . y / width + 1)^3, which may fall below 0; at least 2 rows each.
// Standardise the rows first (by the true set), or the widest columns decide alone. Same bits for
// any worker count.
Result<double> KernelDistance(const FeatureRows& a, const FeatureRows& b, const Workers& workers);

}  // namespace tilegrad::train
