// SPDX-License-Identifier: Apache-2.0
// A small scene with everything in it: two quads, a texture, a light. T: float or double.
#pragma once

#include <tilegrad/tilegrad.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

namespace tilegrad::test {

// Numbers that look random and are always the same, in [-1, 1].
class Numbers {
 public:
  double Next() {
    state_ = state_ * 6364136223846793005u + 1442695040888963407u;
    return static_cast<double>(state_ >> 40) / 8388608.0 - 1;
  }
  template <class T>
  std::vector<T> Vector(std::size_t count, double scale = 1, double shift = 0) {
    std::vector<T> out(count);
    for (T& x : out) x = static_cast<T>(shift + scale * Next());
    return out;
  }

 private:
  std::uint64_t state_ = 7;
};

// A warped grid of 4 x 4 vertices before the camera, in front of a triangle behind it.
template <class T>
struct TestScene {
  std::vector<T> positions, colors, uvs, attributes, texels, sh;
  std::vector<std::int32_t> faces;
  std::vector<TextureT<T>> textures;
  std::vector<SurfaceT<T>> surfaces;
  std::vector<LightT<T>> lights;
  SceneT<T> scene;

  explicit TestScene(Lighting lighting) {
    Numbers numbers;
    for (int v = 0; v < 16; ++v) {
      positions.push_back(static_cast<T>((v % 4) * 0.4 - 0.6 + 0.03 * numbers.Next()));
      positions.push_back(static_cast<T>((v / 4) * 0.4 - 0.6 + 0.03 * numbers.Next()));
      positions.push_back(static_cast<T>(-2 + 0.2 * numbers.Next()));
    }
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        const int v = 4 * row + column;
        for (const int corner : {v, v + 1, v + 5, v, v + 5, v + 4}) faces.push_back(corner);
      }
    }
    colors = numbers.Vector<T>(16 * 3, 0.3, 0.6);
    uvs = numbers.Vector<T>(faces.size() * 2, 0.4, 0.5);
    attributes = numbers.Vector<T>(16 * 2);
    texels = numbers.Vector<T>(5 * 4 * 3, 0.3, 0.6);
    sh = numbers.Vector<T>(9, 0.3);
    textures = {{texels, 5, 4, Wrap::kClamp, Filter::kBilinear}};
    surfaces.resize(1);
    surfaces[0].texture = 0;
    surfaces[0].ambient = {T(0.2), T(0.2), T(0.3)};
    lights = {{{T(0.3), T(0.5), T(1)}, T(0.8)}};
    SetViews(lighting);
  }
  TestScene(const TestScene&) = delete;
  TestScene& operator=(const TestScene&) = delete;

 private:
  void SetViews(Lighting lighting) {
    scene.positions = positions;
    scene.faces = faces;
    scene.camera.fx = scene.camera.fy = 30;
    scene.camera.cx = 17;
    scene.camera.cy = 14;
    scene.colors = {colors, Rate::kVertex};
    scene.uvs = {uvs, Rate::kCorner};
    scene.attributes = {attributes, Rate::kVertex};
    scene.channels = 2;
    scene.textures = textures;
    scene.surfaces = surfaces;
    scene.shading.lighting = lighting;
    const bool sh_lit = lighting == Lighting::kSphericalHarmonics;
    if (sh_lit) scene.sh = sh;
    if (!sh_lit && lighting != Lighting::kNone) scene.lights = lights;
  }
};

inline constexpr RenderOptions kTestOptions{.width = 34, .height = 29, .delta = 1e-3};
inline constexpr Outputs kAll{true, true, true, true, true, true, true};

// Gradients of everything that a TestScene has.
template <class T>
struct TestGradients {
  std::vector<T> positions, colors, uvs, attributes, texels, sh;
  std::vector<std::span<T>> textures;
  std::vector<SurfaceT<T>> surfaces;
  std::vector<LightT<T>> lights;
  CameraT<T> camera;
  SceneGradientsT<T> d;

  explicit TestGradients(const TestScene<T>& s, T fill = T(0))
      : positions(s.positions.size(), fill),
        colors(s.colors.size(), fill),
        uvs(s.uvs.size(), fill),
        attributes(s.attributes.size(), fill),
        texels(s.texels.size(), fill),
        sh(s.scene.sh.size(), fill),
        textures{texels},
        surfaces(1),
        lights(s.scene.lights.size()) {
    d = {positions, &camera, colors, uvs, {}, textures, surfaces, lights, {}, sh, attributes};
  }
  TestGradients(const TestGradients&) = delete;
  TestGradients& operator=(const TestGradients&) = delete;
};

// Cotangents of every image that has gradients.
template <class T>
struct TestCotangents {
  std::vector<T> color, alpha, attributes, depth, normals, uv;
  FrameGradientsT<T> d;

  explicit TestCotangents(const ImagesT<T>& images) {
    Numbers numbers;
    color = numbers.Vector<T>(images.color.size());
    alpha = numbers.Vector<T>(images.alpha.size());
    attributes = numbers.Vector<T>(images.attributes.size());
    depth = numbers.Vector<T>(images.depth.size());
    normals = numbers.Vector<T>(images.normals.size());
    uv = numbers.Vector<T>(images.uv.size());
    d = {color, alpha, attributes, normals, uv, depth};
  }
  TestCotangents(const TestCotangents&) = delete;
  TestCotangents& operator=(const TestCotangents&) = delete;
};

}  // namespace tilegrad::test
