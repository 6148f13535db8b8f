// SPDX-License-Identifier: Apache-2.0
// The derivative of a loss along a random direction in the parameters of an owned scene, by a
// complex step through the reference: without subtraction, hence exact to rounding. For proofs, as
// owned_scene.h.
#pragma once

#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "proof/owned_scene.h"

namespace tilegrad {

// The loss is the sum over the images in `request` of image times cotangent.
struct SlopeProblem {
  const OwnedScene<float>& scene;
  const RenderOptions& options;
  const Outputs& request;
  std::span<const std::int32_t> face_ids;  // [H,W] of the scene's faces
  const OwnedCotangents<double>& d_frame;
};

struct Slope {
  double by_step, by_gradient;
  double size;        // sum of the magnitudes of the gradient's terms
  std::size_t count;  // number of terms
  // A few hundred roundings for each of some thousand terms and for the loss.
  double rounding() const { return 1e-11 * (size + 1); }
};

inline std::complex<double> SlopeLoss(const SlopeProblem& p,
                                      OwnedScene<std::complex<double>>& scene) {
  using Complex = std::complex<double>;
  FrameImagesT<Complex> frame;
  ReferenceRender<Complex>(scene.View(), p.options, p.request, p.face_ids, &frame);
  Complex sum = 0;
  const auto add = [&](const AlignedVector<Complex>& image, const std::vector<double>& weights) {
    for (std::size_t i = 0; i < image.size(); ++i) {
      const bool seen = p.face_ids[i % p.face_ids.size()] >= 0;
      if (seen || std::isfinite(image[i].real())) sum += image[i] * weights[i];  // finite depth
    }
  };
  add(frame.color, p.d_frame.color);
  add(frame.alpha, p.d_frame.alpha);
  add(frame.normals, p.d_frame.normals);
  add(frame.uv, p.d_frame.uv);
  add(frame.depth, p.d_frame.depth);
  add(frame.attributes, p.d_frame.attributes);
  return sum;
}

// Along a random direction, components in [-1, 1], of the numbers that ForEachNumber calls `kind`;
// `gradient`: of these numbers, in the same order.
inline Slope SlopeAlong(const SlopeProblem& problem, const std::string& kind,
                        const std::vector<double>& gradient, Rng rng) {
  constexpr double kStep = 1e-40;  // its square vanishes beside any number
  using Complex = std::complex<double>;
  auto moved = OwnedCast<Complex>(problem.scene);
  Slope slope = {};
  ForEachNumber(moved, [&](const char* name, Complex& x) {
    if (name != kind) return;
    const double direction = rng.Uniform(-1, 1);
    x += Complex(0, direction * kStep);
    const double term = gradient[slope.count++] * direction;
    slope.by_gradient += term;
    slope.size += std::abs(term);
  });
  slope.by_step = SlopeLoss(problem, moved).imag() / kStep;
  return slope;
}

}  // namespace tilegrad
