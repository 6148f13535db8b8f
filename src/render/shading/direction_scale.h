// SPDX-License-Identifier: Apache-2.0
// Normals and light directions that are given may have any length. What is below a threshold after
// interpolation has no direction (shade/normalize.h), which must mean: below it beside the others.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>

#include "base/scalar.h"
#include "render/scene_fields.h"

namespace tilegrad {

// The power of two that brings the largest component of `directions` to about 1; 1 where it is
// that already. It changes neither what becomes of directions nor, as a constant, their derivative.
template <class T>
auto DirectionScale(std::span<const T> directions) {
  using Real = decltype(RealPart(T()));
  Real most = 0;
  for (const T& x : directions) most = std::max(most, std::abs(RealPart(x)));
  if (most == 0 || (most >= Real(0.0625) && most <= Real(16))) return Real(1);
  return std::ldexp(Real(1), std::clamp(-std::ilogb(most), -126, 126));  // float holds it
}

// What a stream of a scene is multiplied by before it is interpolated, and its gradient after.
template <class T>
auto StreamScale(const SceneT<T>& scene, Varying what) {
  const bool directions = what == Varying::kLightDirection ||
                          (what == Varying::kNormal && scene.shading.normals == Normals::kGiven);
  return DirectionScale(directions ? StreamOf(scene, what).values : std::span<const T>());
}

}  // namespace tilegrad
