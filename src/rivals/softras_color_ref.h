// SPDX-License-Identifier: Apache-2.0
// The truth of softras_color.h: every face for every pixel. T: float, double, std::complex<double>.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>

#include "rivals/softras_color.h"
#include "rivals/softras_ref.h"

namespace tilegrad::rivals {

// An image's faces and how they are coloured.
template <class T>
struct SoftRasScene {
  std::span<const T> corners;   // [F,3,3]
  std::span<const T> textures;  // [F,texels,3]
  int size;                     // pixels a side
  SoftRasOptions options;
  SoftRasColors colors;

  std::size_t faces() const { return corners.size() / kCornerNumbers; }
};

// A face's colour at a pixel, and what its texture has to do with it.
template <class T>
struct SoftColorFragment {
  T color[3];
  T share[3];            // of texels `texel[k]`
  std::size_t texel[3];  // of the face
  int count;             // of them: 3 or 1
  T zn;                  // normalised nearness
};

template <class T>
SoftColorFragment<T> ColorFragment(const SoftRasScene<T>& scene, std::size_t face,
                                   const SoftFragment<T>& at) {
  SoftColorFragment<T> out;
  const SoftRasColors& c = scene.colors;
  out.count = c.texture == SoftTexture::kVertex ? 3 : 1;
  for (int k = 0; k < out.count; ++k) {
    out.share[k] = out.count == 3 ? at.w[k] : T(1);
    out.texel[k] = static_cast<std::size_t>(k);
  }
  if (out.count == 1)
    out.texel[0] = SoftTexel<double>(RealPart(at.w[0]), RealPart(at.w[1]), c.resolution, 1e-9);
  for (std::size_t channel = 0; channel < 3; ++channel) {
    out.color[channel] = T(0);
    for (int k = 0; k < out.count; ++k) {
      out.color[channel] +=
          out.share[k] * scene.textures[3 * (face * c.texels() + out.texel[k]) + channel];
    }
  }
  const T far(scene.options.far_plane), near(scene.options.near_plane);
  out.zn = c.inverse_depth ? (T(1) / at.z - T(1) / far) / (T(1) / near - T(1) / far)
                           : (far - at.z) / (far - near);
  return out;
}

// Calls visit(face, number, fragment) for the faces that may have colour at a pixel.
template <class T, class Visit>
void ForColorFaces(const SoftRasScene<T>& scene, const T& px, const T& py, const Visit& visit) {
  SoftFragment<T> at;
  for (std::size_t f = 0; f < scene.faces(); ++f) {
    const SoftFaceRef<T> face(scene.corners, f);
    if (!MakeSoftFragment(face, px, py, scene.options, &at)) continue;
    if (!BetweenPlanes(at.z, scene.options)) continue;
    if (scene.colors.double_side || face.Front()) visit(face, f, at);
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

// The nearest face that covers the pixel, edges included; F: none.
template <class T>
std::size_t NearestCover(const SoftRasScene<T>& scene, const T& px, const T& py,
                         SoftFragment<T>* nearest) {
  std::size_t best = scene.faces();
  ForColorFaces(scene, px, py, [&](const auto&, std::size_t f, const SoftFragment<T>& at) {
    const bool covers = RealPart(at.b[at.least]) >= 0;
    if (!covers || (best < scene.faces() && !(RealPart(at.z) < RealPart(nearest->z)))) return;
    best = f;
    *nearest = at;
  });
  return best;
}

// color: [3,size,size].
template <class T>
void SoftRasColorRef(const SoftRasScene<T>& scene, std::span<T> color) {
  const std::size_t pixels = color.size() / 3;
  for (std::size_t p = 0; p < pixels; ++p) {
    const T px = CentreX<T>(static_cast<int>(p) % scene.size, scene.size);
    const T py = CentreY<T>(static_cast<int>(p) / scene.size, scene.size);
    T out[3] = {T(scene.colors.background[0]), T(scene.colors.background[1]),
                T(scene.colors.background[2])};
    if (scene.colors.color == SoftColor::kSoftmax) {
      std::copy_n(MixColors(scene, px, py).color, 3, out);
    } else {
      SoftFragment<T> at;
      const std::size_t f = NearestCover(scene, px, py, &at);
      if (f < scene.faces()) std::copy_n(ColorFragment(scene, f, at).color, 3, out);
    }
    for (std::size_t channel = 0; channel < 3; ++channel)
      color[channel * pixels + p] = out[channel];
  }
}

// Where gradients of a scene are added; what they are needs no size.
template <class T>
struct SoftRasAdjoints {
  std::span<T> d_corners, d_textures;

  void AddTexture(const SoftRasScene<T>& scene, std::size_t face, const SoftColorFragment<T>& at,
                  const T& weight, const T g[3]) const {
    for (int k = 0; k < at.count; ++k) {
      T* const to = &d_textures[3 * (face * scene.colors.texels() + at.texel[k])];
      for (int channel = 0; channel < 3; ++channel)
        to[channel] += weight * at.share[k] * g[channel];
    }
  }
};

// dzn/dz.
template <class T>
T NearnessSlope(const T& z, const SoftRasOptions& options, const SoftRasColors& colors) {
  const T far(options.far_plane), near(options.near_plane);
  return colors.inverse_depth ? -T(1) / (z * z * (T(1) / near - T(1) / far)) : -T(1) / (far - near);
}

// The repair: corners move the weights w that colour and depth of a pixel are interpolated by.
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

// A face's part of the mixture's adjoint.
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
  out.AddTexture(scene, f, here, weight, g);
  T* const d_corners = &out.d_corners[kCornerNumbers * f];
  if (scene.options.distance != SoftDistance::kHard) {
    const T d_d = along * per_probability * at.probability * at.miss / scene.options.sigma;
    AddDistanceAdjoint(face, at, scene.options, d_d, d_corners);
  }
  const T d_z =
      weight / T(scene.colors.gamma) * along * NearnessSlope(at.z, scene.options, scene.colors);
  T d_w[3];
  for (int k = 0; k < 3; ++k) {
    const T over = at.z / face.at.z[k];
    d_corners[3 * k + 2] += d_z * at.w[k] * over * over;
    d_w[k] = -d_z * at.z * over;
    for (int channel = 0; channel < 3 && here.count == 3; ++channel) {
      d_w[k] += weight * g[channel] *
                scene.textures[3 * (f * 3 + static_cast<std::size_t>(k)) +
                               static_cast<std::size_t>(channel)];
    }
  }
  if (scene.colors.position_gradient) AddWeightAdjoint(face, at, d_w, d_corners);
}

// Adds to d_corners [F,3,3] and d_textures [F,texels,3] from d_color [3,size,size].
template <class T>
void SoftRasColorBackwardRef(const SoftRasScene<T>& scene, std::span<const T> d_color,
                             const SoftRasAdjoints<T>& out) {
  const std::size_t pixels = d_color.size() / 3;
  for (std::size_t p = 0; p < pixels; ++p) {
    const T px = CentreX<T>(static_cast<int>(p) % scene.size, scene.size);
    const T py = CentreY<T>(static_cast<int>(p) / scene.size, scene.size);
    const T g[3] = {d_color[p], d_color[pixels + p], d_color[2 * pixels + p]};
    if (scene.colors.color == SoftColor::kSoftmax) {
      const SoftColorPixel<T> pixel = MixColors(scene, px, py);
      ForColorFaces(scene, px, py,
                    [&](const SoftFaceRef<T>& face, std::size_t f, const SoftFragment<T>& at) {
                      AddMixtureAdjoint(scene, pixel, g, face, f, at, out);
                    });
      continue;
    }
    SoftFragment<T> at;
    const std::size_t f = NearestCover(scene, px, py, &at);
    if (f < scene.faces()) out.AddTexture(scene, f, ColorFragment(scene, f, at), T(1), g);
  }
}

}  // namespace tilegrad::rivals
