// SPDX-License-Identifier: Apache-2.0
// A scene's alpha, transmittance and gradients held to all faces in double, within E + the rounding
// that docs/numerics.md derives.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "raster/soft_mask/soft_mask.h"
#include "raster/soft_mask/test_util.h"
#include "support/expect.h"

namespace tilegrad::raster::test {

inline void CheckAlpha(const SoftScene& scene, const SoftTruth& truth, const SoftResult& result) {
  const double e = scene.options.max_alpha_error;
  // exp(-87) per face is what E = 0 means ("Budget").
  EXPECT_LE(result.spent, e * (1 + 1e-12) + 1.7e-38 * static_cast<double>(scene.options.faces));
  for (std::size_t i = 0; i < scene.pixels(); ++i) {
    if (scene.face_ids[i] >= 0) {
      EXPECT_EQ(result.alpha[i], 1.0f);
      continue;
    }
    const double error = std::abs(static_cast<double>(result.alpha[i]) - truth.Alpha(i));
    EXPECT_LE(error, result.spent + truth.Rounding(i)) << "pixel " << i << " E " << e;
  }
}

// Error of the gradient of corner k and of the corners that coincide with it: which of them is the
// nearest is a matter of rounding, their sum is not.
inline std::array<double, 2> MergedError(const SoftScene& scene, std::size_t face,
                                         std::size_t corner, const std::vector<double>& exact,
                                         const std::vector<float>& actual) {
  std::array<double, 2> error{};
  const std::size_t vertex = 3 * face + corner;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t other = 3 * face + k;
    if (scene.mesh.x[other] != scene.mesh.x[vertex]) continue;
    if (scene.mesh.y[other] != scene.mesh.y[vertex]) continue;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      error[axis] += static_cast<double>(actual[2 * other + axis]) - exact[2 * other + axis];
    }
  }
  return error;
}

inline void CheckGradient(const SoftScene& scene, const SoftTruth& truth,
                          const std::vector<float>& d_alpha, const SoftResult& result) {
  std::vector<double> exact, tolerance;
  truth.Gradient(d_alpha, &exact, &tolerance);
  for (std::size_t f = 0; f < scene.options.faces; ++f) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto error = MergedError(scene, f, k, exact, result.d_corners);
      for (std::size_t axis = 0; axis < 2; ++axis) {
        EXPECT_LE(std::abs(error[axis]), 3 * tolerance[6 * f + axis])
            << "face " << f << " corner " << k << " axis " << axis << " E "
            << scene.options.max_alpha_error << " delta " << scene.options.delta;
      }
    }
  }
}

// Pixels at which the nearest feature is a matter of rounding have no gradient to compare.
inline std::vector<float> ComparableGradient(const SoftScene& scene, const SoftTruth& truth) {
  std::vector<float> d_alpha = scene.d_alpha;
  for (std::size_t i = 0; i < d_alpha.size(); ++i) {
    if (truth.Ambiguous(i)) d_alpha[i] = 0;
  }
  return d_alpha;
}

// The place of pixel i where blocks of 8 x 8 come one after the other.
inline std::size_t BlockOrder(const SoftScene& scene, std::size_t i) {
  const auto w = static_cast<std::size_t>(scene.options.width);
  const auto h = static_cast<std::size_t>(scene.options.height);
  const std::size_t x = i % w, y = i / w, x0 = x / 8 * 8, y0 = y / 8 * 8;
  const std::size_t width = std::min<std::size_t>(8, w - x0);
  const std::size_t height = std::min<std::size_t>(8, h - y0);
  return y0 * w + x0 * height + (y - y0) * width + x - x0;
}

// Lanes that leave at least 1/64 each are off by 42 u a / (1 - a), which is no more than
// 42 u (63 / ln 64) = 636 u times the logarithm of what they leave ("Gradients").
inline void CheckTransmittance(const SoftScene& scene, const SoftTruth& truth,
                               const SoftResult& result) {
  const double e = scene.options.max_alpha_error, u = 0x1p-24;
  for (std::size_t i = 0; i < scene.pixels(); ++i) {
    const auto alpha = static_cast<double>(result.alpha[i]);
    if (scene.face_ids[i] >= 0 || alpha <= e / 4) continue;
    const auto known = static_cast<double>(result.transmittance[BlockOrder(scene, i)]);
    const auto [product, most] = truth.Products(i);
    const double rounding = truth.Rounding(i);
    if (known == 0) {
      EXPECT_LE(most, e / 4 + rounding) << "pixel " << i;
    }
    if (known <= 0) continue;
    const double of_lanes = 636 * u * (1 - std::log(product)) * product;
    EXPECT_LE(std::abs(known - product), result.spent + rounding - 42 * u * alpha + of_lanes)
        << "pixel " << i;
  }
}

// On every target.
inline void CheckScene(const SoftScene& scene, SoftMaskScratch* scratch, const SoftRun& run = {}) {
  const SoftTruth truth(scene);
  const auto d_alpha = ComparableGradient(scene, truth);
  for (const std::string target : EveryTarget()) {
    const SoftResult result = RunSoftMask(scene, d_alpha, scratch, run);
    CheckAlpha(scene, truth, result);
    CheckTransmittance(scene, truth, result);
    CheckGradient(scene, truth, d_alpha, result);
  }
}

}  // namespace tilegrad::raster::test
