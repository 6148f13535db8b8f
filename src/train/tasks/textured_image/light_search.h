// SPDX-License-Identifier: Apache-2.0
// The light of a picture, given what is thought of the object in it: the direction that explains
// the picture best, by trying many. The error of colours says little about a light that is far from
// the right one (what it does not reach is black, and stays so when it moves a little), so a
// network that follows its gradient learns lights slowly; the direction found here is a target for
// it.
#pragma once

#include <array>
#include <span>
#include <vector>

namespace tilegrad::train {

// One picture of `pixels` pixels, planar.
template <class T>
struct LightEvidence {
  std::span<const T> texture;  // [3][pixels]: the object in this view without light
  std::span<const T> normals;  // [3][pixels]: unit, in world axes; 0 beside the object
  std::span<const T> picture;  // [3][pixels]
  std::span<const T> cover;    // [pixels]: how much of each is the object, in [0, 1]
};

// Directions spread evenly over a spherical cap, finer around the best one: Lambert's law with a
// constant `ambient`, compared by L1.
class LightSearch {
 public:
  // `spread`: half angle of the cap around the camera's axis, degrees.
  LightSearch(double spread, double ambient);

  // Unit, in the axes of the camera with `rotation`, row-major; 0 where the picture shows nothing.
  template <class T>
  std::array<double, 3> Find(const LightEvidence<T>& evidence,
                             std::span<const float, 9> rotation) const;

 private:
  double cosine_, ambient_;
  std::vector<std::array<double, 3>> directions_;
};

}  // namespace tilegrad::train
