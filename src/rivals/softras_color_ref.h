// SPDX-License-Identifier: Apache-2.0
// Scalar reference of softras_color.h: every face at every pixel. T: float, double,
// std::complex<double>.
#pragma once

#include <cmath>

#include "rivals/softras_color.h"
#include "rivals/softras_ref.h"

namespace tilegrad::rivals {

// An image's faces and their colours.
template <class T>
struct SoftRasScene {
  std::span<const T> corners;   // [F,3,3]
  std::span<const T> textures;  // [F,3,3]
  int size;                     // pixels a side
  SoftRasOptions options;
  SoftRasColors colors;

  std::size_t faces() const { return corners.size() / kCornerNumbers; }
};

// A face's colour at a pixel, and its normalised nearness.
template <class T>
struct SoftColorFragment {
  T color[3], zn;
};

template <class T>
SoftColorFragment<T> ColorFragment(const SoftRasScene<T>& scene, std::size_t face,
                                   const SoftFragment<T>& at) {
  SoftColorFragment<T> out;
  for (std::size_t channel = 0; channel < 3; ++channel) {
    out.color[channel] = T(0);
    for (std::size_t k = 0; k < kSoftTexels; ++k)
      out.color[channel] += at.w[k] * scene.textures[3 * (face * kSoftTexels + k) + channel];
  }
  const T far(scene.options.far_plane), near(scene.options.near_plane);
  out.zn = (far - at.z) / (far - near);
  return out;
}

// Calls visit(face, number, fragment) for the faces that may contribute colour at a pixel.
template <class T, class Visit>
void ForColorFaces(const SoftRasScene<T>& scene, const T& px, const T& py, const Visit& visit) {
  SoftFragment<T> at;
  for (std::size_t f = 0; f < scene.faces(); ++f) {
    const SoftFaceRef<T> face(scene.corners, f);
    if (!MakeSoftFragment(face, px, py, scene.options, &at)) continue;
    if (BetweenPlanes(at.z, scene.options)) visit(face, f, at);
  }
}

// A pixel's mixture, weights relative to e^(largest / gamma).
template <class T>
struct SoftColorPixel {
  double largest;
  T total, color[3];
};

// e^((zn - largest) / gamma): no weight overflows.
template <class T>
T DepthWeight(const T& zn, double largest, const SoftRasColors& colors) {
  using std::exp;
  return exp((zn - T(largest)) / T(colors.gamma));
}

template <class T>
SoftColorPixel<T> MixColors(const SoftRasScene<T>& scene, const T& px, const T& py) {
  const SoftRasColors& c = scene.colors;
  const double back = c.BackgroundDepth();
  SoftColorPixel<T> out{back, T(0), {}};
  ForColorFaces(scene, px, py, [&](const auto&, std::size_t f, const SoftFragment<T>& at) {
    out.largest = std::max<double>(out.largest, RealPart(ColorFragment(scene, f, at).zn));
  });
  out.total = DepthWeight(T(back), out.largest, c);
  for (int channel = 0; channel < 3; ++channel)
    out.color[channel] = out.total * T(c.background[channel]);
  ForColorFaces(scene, px, py, [&](const auto&, std::size_t f, const SoftFragment<T>& at) {
    const SoftColorFragment<T> here = ColorFragment(scene, f, at);
    const T weight = at.probability * DepthWeight(here.zn, out.largest, c);
    out.total += weight;
    for (int channel = 0; channel < 3; ++channel)
      out.color[channel] += weight * here.color[channel];
  });
  for (T& channel : out.color) channel /= out.total;
  return out;
}

// color: [3,size,size].
template <class T>
void SoftRasColorRef(const SoftRasScene<T>& scene, std::span<T> color) {
  const std::size_t pixels = color.size() / 3;
  for (std::size_t p = 0; p < pixels; ++p) {
    const T px = CentreX<T>(static_cast<int>(p) % scene.size, scene.size);
    const T py = CentreY<T>(static_cast<int>(p) / scene.size, scene.size);
    const SoftColorPixel<T> pixel = MixColors(scene, px, py);
    for (std::size_t channel = 0; channel < 3; ++channel)
      color[channel * pixels + p] = pixel.color[channel];
  }
}

// Destinations to which gradients of a scene are added.
template <class T>
struct SoftRasAdjoints {
  std::span<T> d_corners, d_textures;
};

// The repair: corners also move the interpolation weights w of a pixel's colour and depth.
// d_w: their adjoint.
template <class T>
void AddWeightAdjoint(const SoftFaceRef<T>& face, const SoftFragment<T>& at, const T d_w[3],
                      T* d_corners) {
  T sum = T(0), mean = T(0), d_b[3];
  for (int k = 0; k < 3; ++k) {
    const double b = RealPart(at.b[k]);
    sum += b < 0 ? T(0) : b > 1 ? T(1) : at.b[k];
    mean += at.w[k] * d_w[k];
  }
  for (int k = 0; k < 3; ++k) {
    const bool free = RealPart(at.b[k]) > 0 && RealPart(at.b[k]) < 1;
    d_b[k] = free ? (d_w[k] - mean) / sum : T(0);
  }
  AddBarycentricAdjoint(face.at, face.area2, at.b, d_b, d_corners);
}

// A face's contribution to the adjoint of the mixture.
template <class T>
void AddMixtureAdjoint(const SoftRasScene<T>& scene, const SoftColorPixel<T>& pixel, const T g[3],
                       const SoftFaceRef<T>& face, std::size_t f, const SoftFragment<T>& at,
                       const SoftRasAdjoints<T>& out) {
  const SoftColorFragment<T> here = ColorFragment(scene, f, at);
  const T per_probability = DepthWeight(here.zn, pixel.largest, scene.colors) / pixel.total;
  const T weight = at.probability * per_probability;
  T along = T(0);
  for (int channel = 0; channel < 3; ++channel)
    along += g[channel] * (here.color[channel] - pixel.color[channel]);
  T* const d_corners = &out.d_corners[kCornerNumbers * f];
  if (scene.options.distance != SoftDistance::kHard) {
    const T d_d = along * per_probability * at.probability * at.miss / scene.options.sigma;
    AddDistanceAdjoint(face, at, scene.options, d_d, d_corners);
  }
  const T slope = -T(1) / (T(scene.options.far_plane) - T(scene.options.near_plane));  // dzn/dz
  const T d_z = weight / T(scene.colors.gamma) * along * slope;
  T d_w[3];
  for (std::size_t k = 0; k < kSoftTexels; ++k) {
    const T over = at.z / face.at.z[k];
    d_corners[3 * k + 2] += d_z * at.w[k] * over * over;
    d_w[k] = -d_z * at.z * over;
    for (std::size_t channel = 0; channel < 3; ++channel) {
      const std::size_t number = 3 * (f * kSoftTexels + k) + channel;
      d_w[k] += weight * g[channel] * scene.textures[number];
      out.d_textures[number] += weight * at.w[k] * g[channel];
    }
  }
  if (scene.colors.position_gradient) AddWeightAdjoint(face, at, d_w, d_corners);
}

// Adds to d_corners [F,3,3] and d_textures [F,3,3] from d_color [3,size,size].
template <class T>
void SoftRasColorBackwardRef(const SoftRasScene<T>& scene, std::span<const T> d_color,
                             const SoftRasAdjoints<T>& out) {
  const std::size_t pixels = d_color.size() / 3;
  for (std::size_t p = 0; p < pixels; ++p) {
    const T px = CentreX<T>(static_cast<int>(p) % scene.size, scene.size);
    const T py = CentreY<T>(static_cast<int>(p) / scene.size, scene.size);
    const T g[3] = {d_color[p], d_color[pixels + p], d_color[2 * pixels + p]};
    const SoftColorPixel<T> pixel = MixColors(scene, px, py);
    ForColorFaces(scene, px, py,
                  [&](const SoftFaceRef<T>& face, std::size_t f, const SoftFragment<T>& at) {
                    AddMixtureAdjoint(scene, pixel, g, face, f, at, out);
                  });
  }
}

}  // namespace tilegrad::rivals
