// SPDX-License-Identifier: Apache-2.0
// What tests of the rivals share: vectors of independent numbers, random faces, comparisons.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/rng.h"
#include "support/shared_data.h"

namespace tilegrad::rivals::test {

template <class T>
double Largest(const std::vector<T>& values) {
  double largest = 0;
  for (const T v : values) largest = std::max(largest, std::abs(static_cast<double>(v)));
  return largest;
}

// The largest |a - b|; NaN counts as infinite.
template <class A, class B>
double Difference(const std::vector<A>& a, const std::vector<B>& b) {
  EXPECT_EQ(a.size(), b.size());
  double largest = 0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    const double off = std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i]));
    largest = std::max(largest, std::isnan(off) ? INFINITY : off);
  }
  return largest;
}

// Gradients of corners [F,3,3] without the numbers of z.
template <class T>
std::vector<T> PlaneParts(const std::vector<T>& corners) {
  std::vector<T> out;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (i % 3 != 2) out.push_back(corners[i]);
  }
  return out;
}

template <class T>
std::vector<T> Random(std::size_t count, double low, double high, Rng* rng) {
  std::vector<T> out(count);
  for (T& v : out) v = static_cast<T>(static_cast<float>(rng->Uniform(low, high)));
  return out;
}

// Faces of about `extent` anywhere on the image and a little beyond, depths 2 to 3.
template <class T>
std::vector<T> RandomCorners(std::size_t faces, double extent, Rng* rng) {
  std::vector<T> out;
  for (std::size_t f = 0; f < faces; ++f) {
    const double x = rng->Uniform(-1.1, 1.1), y = rng->Uniform(-1.1, 1.1);
    for (int k = 0; k < 3; ++k) {
      const double corner[3] = {x + extent * rng->Uniform(-1, 1), y + extent * rng->Uniform(-1, 1),
                                rng->Uniform(2, 3)};
      for (const double c : corner) out.push_back(static_cast<T>(static_cast<float>(c)));
    }
  }
  return out;
}

// `sound` and after it faces that no rule draws: without area, without numbers, without bound.
inline std::vector<float> WithOddFaces(std::vector<float> sound) {
  const float inf = INFINITY, nan = NAN;
  for (const std::vector<float>& odd :
       {std::vector<float>{0, 0, 2, 0.5f, 0.5f, 2, -0.5f, -0.5f, 2},  // collinear
        {nan, 0, 2, 1, 0, 2, 0, 1, 2},
        {0, 0, 2, inf, 0, 2, 0, 1, 2},
        {0, 0, nan, 1, 0, 2, 0, 1, 2},
        {1e30f, 0, 2, -1e30f, 1e30f, 2, -1e30f, -1e30f, 2}}) {
    sound.insert(sound.end(), odd.begin(), odd.end());
  }
  return sound;
}

}  // namespace tilegrad::rivals::test
