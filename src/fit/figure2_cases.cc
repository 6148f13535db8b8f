// SPDX-License-Identifier: Apache-2.0
// The eight scenes of Figure 2, from built-in shapes.
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "fit/figure2.h"
#include "scene/shapes.h"

namespace tilegrad::train {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

// A smooth shape with no symmetry: a sphere with bumps.
glm::vec3 Bumpy(glm::vec3 p) {
  const float bump = 0.22f * std::sin(3 * p.x + 1) * std::cos(4 * p.y) + 0.15f * std::sin(5 * p.z);
  const float radius = 1 + bump;
  return radius * glm::vec3(p.x, 0.8f * p.y, p.z);
}

glm::vec3 Rainbow(glm::vec3 p) {
  return 0.5f + 0.45f * glm::vec3(std::sin(3 * p.x), std::sin(3 * p.y + 2), std::sin(3 * p.z + 4));
}

Mesh BumpySphere(int level) {
  Mesh mesh = Icosphere(level, 1);
  for (glm::vec3& p : mesh.positions) p = Bumpy(p);
  return mesh;
}

// A checkerboard with a gradient, soft enough at its borders that uv have a direction to go.
Image Pattern(int width, int height) {
  Image image(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const float u = (static_cast<float>(x) + 0.5f) / static_cast<float>(width);
      const float v = (static_cast<float>(y) + 0.5f) / static_cast<float>(height);
      const float checks = std::tanh(3 * std::sin(8 * kPi * u) * std::sin(6 * kPi * v));
      image.at(x, y)[0] = 0.5f + 0.4f * checks;
      image.at(x, y)[1] = 0.5f + 0.4f * std::sin(2 * kPi * u);
      image.at(x, y)[2] = 0.5f - 0.4f * std::cos(2 * kPi * v);
    }
  }
  return image;
}

Camera CameraAt(int size, double azimuth, double elevation, double distance) {
  return OrbitCamera({40, size, size}, azimuth, elevation, distance);
}

FitScene PlainScene(const Mesh& mesh, int size) {
  FitScene scene = SceneOfMesh(mesh).value();  // a built-in shape always has one
  scene.cameras = {CameraAt(size, 60, 25, 4)};
  return scene;
}

void ColorByPlace(FitScene* scene) {
  scene->colors.clear();
  for (std::size_t i = 0; i < scene->positions.size(); i += 3) {
    const float* p = &scene->positions[i];
    const glm::vec3 c = Rainbow({p[0], p[1], p[2]});
    scene->colors.insert(scene->colors.end(), {c.r, c.g, c.b});
  }
}

void Fill(std::vector<float>* values, float value) { values->assign(values->size(), value); }

FitScene TexturedScene(int size) {
  FitScene scene = PlainScene(BumpySphere(3), size);
  SetSphereUv(Icosphere(3, 1), &scene);
  scene.colors.clear();
  scene.texture = Pattern(96, 48);
  return scene;
}

FitScene LitScene(const Mesh& mesh, int size, Lighting lighting) {
  FitScene scene = PlainScene(mesh, size);
  for (std::size_t i = 0; i < scene.colors.size(); i += 3) {
    scene.colors[i] = 0.9f, scene.colors[i + 1] = 0.75f, scene.colors[i + 2] = 0.6f;
  }
  scene.shading.lighting = lighting;
  scene.lights = {{{0.6f, 0.7f, 0.4f}, 1}};
  return scene;
}

// What all cases share; the start is the target until the caller spoils it.
Figure2Case Make(const char* label, Parameter parameter, FitScene target) {
  Figure2Case one;
  one.label = label, one.parameter = parameter;
  one.start = target, one.target = std::move(target);
  return one;
}

Figure2Case VertexPosition(int size) {
  FitScene target = PlainScene(BumpySphere(3), size);
  ColorByPlace(&target);
  Figure2Case one = Make("a", Parameter::kPositions, std::move(target));
  one.what = "vertex position", one.model = "vertex colour";
  one.start.positions = PlainScene(Icosphere(3, 0.9f), size).positions;
  one.learning_rate = 0.03, one.smoothing = 1;
  return one;
}

Figure2Case VertexColor(int size) {
  FitScene target = PlainScene(BumpySphere(3), size);
  ColorByPlace(&target);
  Figure2Case one = Make("b", Parameter::kColors, std::move(target));
  one.what = "vertex colour", one.model = "vertex colour";
  Fill(&one.start.colors, 0.5f);
  one.learning_rate = 0.02;
  return one;
}

Figure2Case TextureCase(int size) {
  Figure2Case one = Make("c", Parameter::kTexture, TexturedScene(size));
  one.what = "texture", one.model = "texture";
  Fill(&one.start.texture.pixels, 0.5f);
  one.learning_rate = 0.03;
  return one;
}

Figure2Case UvCase(int size) {
  Figure2Case one = Make("d", Parameter::kUv, TexturedScene(size));
  one.what = "texture coordinates", one.model = "texture";
  std::vector<float>& uvs = one.start.uvs;
  for (std::size_t i = 0; i < uvs.size(); i += 2) {
    const float u = uvs[i], v = uvs[i + 1];
    uvs[i] = u + 0.03f * std::sin(4 * kPi * v);
    uvs[i + 1] = v + 0.04f * std::sin(6 * kPi * u);
  }
  one.learning_rate = 0.002;
  return one;
}

Figure2Case LambertPosition(int size) {
  Figure2Case one =
      Make("e", Parameter::kPositions, LitScene(BumpySphere(3), size, Lighting::kLambert));
  one.what = "vertex position", one.model = "Lambert";
  one.start.positions = PlainScene(Icosphere(3, 0.9f), size).positions;
  one.learning_rate = 0.03, one.smoothing = 1;
  return one;
}

Figure2Case CameraPosition(int size) {
  Figure2Case one =
      Make("f", Parameter::kCamera, LitScene(BumpySphere(3), size, Lighting::kLambert));
  one.what = "camera position", one.model = "Lambert";
  one.start.cameras = {CameraAt(size, 85, 10, 4.6)};
  one.learning_rate = 0.02, one.delta = 1.0 / 1000;
  return one;
}

Figure2Case GreyHarmonicLight(int size) {
  FitScene target = LitScene(Torus(0.85f, 0.38f, 48, 24), size, Lighting::kSphericalHarmonics);
  target.sh = {2.2f, -0.5f, 0.4f, -0.7f, 0.3f, -0.2f, 0.25f, -0.3f, 0.35f};
  Figure2Case one = Make("g", Parameter::kSh, std::move(target));
  one.what = "light", one.model = "spherical harmonics";
  one.start.sh = {1, 0.5f, -0.6f, 0.6f, 0, 0, 0, 0, 0};
  one.learning_rate = 0.04;
  return one;
}

Figure2Case PhongMaterial(int size) {
  FitScene target = LitScene(Torus(0.85f, 0.38f, 48, 24), size, Lighting::kPhong);
  target.surface.ambient = {0.1f, 0.1f, 0.1f};
  target.surface.diffuse = {0.8f, 0.6f, 0.4f};
  target.surface.specular = {0.5f, 0.5f, 0.5f};
  target.surface.shininess = 40;
  Figure2Case one = Make("h", Parameter::kMaterial, std::move(target));
  one.what = "material", one.model = "Phong";
  one.start.surface.ambient = {0.3f, 0.3f, 0.3f};
  one.start.surface.diffuse = {0.4f, 0.4f, 0.8f};
  one.start.surface.specular = {0.2f, 0.2f, 0.2f};
  one.start.surface.shininess = 5;
  one.learning_rate = 0.03;
  return one;
}

}  // namespace

std::vector<Figure2Case> Figure2Cases(int size) {
  return {
      VertexPosition(size),  VertexColor(size),    TextureCase(size),       UvCase(size),
      LambertPosition(size), CameraPosition(size), GreyHarmonicLight(size), PhongMaterial(size)};
}

}  // namespace tilegrad::train
