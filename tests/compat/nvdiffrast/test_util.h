// SPDX-License-Identifier: Apache-2.0
// Scenes for the tests of nvdiffrast's operations. Their gradients: test_nvdiffrast.py.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/rng.h"
#include "compat/nvdiffrast/rasterize.h"
#include "support/expect.h"

namespace tilegrad::compat::nvdiffrast {

template <class T>
using Numbers = std::vector<T>;

// Numbers in [-1, 1).
template <class T>
Numbers<T> RandomNumbers(std::size_t n, std::uint64_t seed) {
  Rng rng(seed, 3);
  Numbers<T> out(n);
  for (T& v : out) v = static_cast<T>(rng.Uniform(-1, 1));
  return out;
}

template <class T, class U>
Numbers<T> As(const Numbers<U>& from) {
  return {from.begin(), from.end()};
}

template <class T>
double Dot(std::span<const T> a, std::span<const T> b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    sum += static_cast<double>(a[i]) * static_cast<double>(b[i]);
  }
  return sum;
}

// What an operation of float is off by at most, relative to its result.
inline constexpr double kRounding = 0x1p-24;

// tolerance(i): of number i.
template <class Tolerance>
void ExpectWithin(const char* what, const Numbers<float>& got, const Numbers<double>& expected,
                  const Tolerance& tolerance) {
  ASSERT_EQ(got.size(), expected.size()) << what;
  for (std::size_t i = 0; i < got.size(); ++i) {
    ASSERT_NEAR(double{got[i]}, expected[i], tolerance(i)) << what << " " << i;
  }
}

// A mesh over positions in clip space, with its images.
template <class T>
struct Scene {
  Numbers<T> positions;  // [N,V,4]
  std::vector<std::int32_t> faces, ranges;
  std::size_t images = 1;
  bool shared = false;
  int height = 8, width = 8;

  std::size_t vertices() const { return positions.size() / 4 / (shared ? 1 : images); }
  PixelGrid grid() const { return {images, height, width}; }
  RasterizeInput<T> input() const {
    return {{positions, vertices(), 4, shared}, faces, ranges, grid()};
  }
};

template <class T>
struct Rasterized {
  Numbers<T> rast, rast_db;
};

template <class T>
Rasterized<T> Rasterize(const Scene<T>& scene, const Workers& workers = Workers(1),
                        Numbers<float>* peeled = nullptr) {
  Rasterized<T> out;
  out.rast.assign(4 * scene.grid().pixels(), T(-7));
  out.rast_db.assign(4 * scene.grid().pixels(), T(-7));
  Rasterizer rasterizer;
  Ok(rasterizer.Run(
      scene.input(), workers,
      {out.rast, out.rast_db, peeled == nullptr ? std::span<float>() : std::span<float>(*peeled)}));
  return out;
}

// Faces with corners of their own anywhere around the frustum, some behind the eye.
inline Scene<double> Soup(std::size_t faces, std::uint64_t seed, int height, int width) {
  Scene<double> out;
  out.height = height;
  out.width = width;
  Rng rng(seed, 1);
  for (std::size_t v = 0; v < 3 * faces; ++v) {
    const double w = rng.Uniform(-0.5, 2.0);
    for (int i = 0; i < 3; ++i) out.positions.push_back(rng.Uniform(-1.5, 1.5));
    out.positions.push_back(w);
    out.faces.push_back(static_cast<std::int32_t>(v));
  }
  return out;
}

// Adds faces with corners of their own.
inline void AddSoup(std::size_t faces, std::uint64_t seed, Scene<double>* scene) {
  auto first = static_cast<std::int32_t>(scene->vertices());
  const Scene<double> soup = Soup(faces, seed, 1, 1);
  scene->positions.insert(scene->positions.end(), soup.positions.begin(), soup.positions.end());
  for (std::size_t v = 0; v < 3 * faces; ++v) scene->faces.push_back(first++);
}

// A wavy grid of n x n quads, seen in perspective, within the image; faces share vertices.
inline Scene<double> WavyGrid(int n, std::uint64_t seed, int height, int width) {
  Scene<double> out;
  out.height = height;
  out.width = width;
  Rng rng(seed, 2);
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j <= n; ++j) {
      const double w = rng.Uniform(1.0, 1.6);
      out.positions.push_back(w * (1.6 * j / n - 0.8 + rng.Uniform(-0.1, 0.1) / n));
      out.positions.push_back(w * (1.6 * i / n - 0.8 + rng.Uniform(-0.1, 0.1) / n));
      out.positions.push_back(w * rng.Uniform(-0.3, 0.3));
      out.positions.push_back(w);
    }
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const int a = i * (n + 1) + j, b = a + 1, c = a + n + 1, d = c + 1;
      for (const int v : {a, b, d, a, d, c}) out.faces.push_back(v);
    }
  }
  return out;
}

template <class T>
Scene<T> AsScene(const Scene<double>& from) {
  Scene<T> out;
  out.positions = As<T>(from.positions);
  out.faces = from.faces;
  out.ranges = from.ranges;
  out.images = from.images;
  out.shared = from.shared;
  out.height = from.height;
  out.width = from.width;
  return out;
}

}  // namespace tilegrad::compat::nvdiffrast
