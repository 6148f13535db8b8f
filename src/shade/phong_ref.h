// SPDX-License-Identifier: Apache-2.0
// Scalar reference of phong.h, for one light. T: float, double, std::complex<double>.
#pragma once

#include <cmath>

#include "base/scalar.h"
#include "shade/phong.h"
#include "shade/vec3_ref.h"

namespace tilegrad::shade {

template <class T>
struct PhongVectors {
  Vec3<T> normal, light, eye;
};

// A value clamped to [least, 1]; `inside`: whether it was within.
template <class T>
struct Clamped {
  T value;
  bool inside;
};

template <class T>
Clamped<T> ClampRef(const T& x, float least) {
  const auto real = RealPart(x);
  if (!(real >= least)) return {T(least), false};
  if (real > 1) return {T(1), false};
  return {x, true};
}

template <class T>
struct Reflection {
  Clamped<T> cosine;
  Vec3<T> direction;  // R
  Clamped<T> toward_eye;
};

template <class T>
Reflection<T> ReflectRef(const PhongVectors<T>& v) {
  Reflection<T> out;
  out.cosine = ClampRef(Dot(v.normal, v.light), 0);
  out.direction = {-v.light[0], -v.light[1], -v.light[2]};
  AddScaled(T(2) * out.cosine.value, v.normal, out.direction);
  out.toward_eye = ClampRef(Dot(out.direction, v.eye), kLeastReflection);
  return out;
}

template <class T>
T PhongRef(const PhongVectors<T>& v, const T& shininess) {
  using std::exp, std::log;
  return exp(shininess * log(ReflectRef(v).toward_eye.value));
}

// Adds to d_v and *d_shininess.
template <class T>
void PhongAdjointRef(const PhongVectors<T>& v, const T& shininess, const T& d_highlight,
                     PhongVectors<T>& d_v, T* d_shininess) {
  using std::exp, std::log;
  const Reflection<T> r = ReflectRef(v);
  const T logarithm = log(r.toward_eye.value);
  const T d_power = d_highlight * exp(shininess * logarithm);
  *d_shininess += d_power * logarithm;
  if (!r.toward_eye.inside) return;
  const T d_r = d_power * shininess / r.toward_eye.value;
  AddScaled(d_r, r.direction, d_v.eye);
  AddScaled(-d_r, v.eye, d_v.light);
  AddScaled(T(2) * r.cosine.value * d_r, v.eye, d_v.normal);
  if (!r.cosine.inside) return;
  const T d_cosine = T(2) * d_r * Dot(v.normal, v.eye);
  AddScaled(d_cosine, v.light, d_v.normal);
  AddScaled(d_cosine, v.normal, d_v.light);
}

}  // namespace tilegrad::shade
