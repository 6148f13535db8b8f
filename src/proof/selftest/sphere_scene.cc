// SPDX-License-Identifier: Apache-2.0
#include "proof/selftest/sphere_scene.h"

#include <algorithm>

#include "render/scene_fields.h"
#include "scene/shapes.h"

namespace tilegrad::selftest {
namespace {

float Random(Rng* rng, double low, double high) {
  return static_cast<float>(rng->Uniform(low, high));
}

std::vector<float> RandomNumbers(std::size_t count, double low, double high, Rng* rng) {
  std::vector<float> out(count);
  for (float& x : out) x = Random(rng, low, high);
  return out;
}

std::array<float, 3> RandomTriple(double low, double high, Rng* rng) {
  return {Random(rng, low, high), Random(rng, low, high), Random(rng, low, high)};
}

// Three away from the origin, at which it looks, from the side; with this f a sphere of 0.8 leaves
// a sixth of the image free on each side.
CameraT<float> SideCamera(const SphereShape& shape) {
  CameraT<float> camera;
  constexpr double kAxes[9] = {2.0 / 3, -2.0 / 3, 1.0 / 3,  1.0 / 3, 2.0 / 3,
                               2.0 / 3, -2.0 / 3, -1.0 / 3, 2.0 / 3};
  std::transform(kAxes, kAxes + 9, camera.rotation, [](double x) { return static_cast<float>(x); });
  camera.translation[2] = -3;
  camera.fx = camera.fy = 1.25f * static_cast<float>(std::min(shape.width, shape.height));
  camera.cx = 0.5f * static_cast<float>(shape.width);
  camera.cy = 0.5f * static_cast<float>(shape.height);
  camera.near_plane = shape.near_plane;
  return camera;
}

void AddMesh(const SphereShape& shape, Rng* rng, OwnedScene<float>* scene) {
  const Mesh sphere = Icosphere(shape.level, 0.8f);
  for (const glm::vec3& p : sphere.positions) {
    for (int k = 0; k < 3; ++k) {
      scene->mesh.positions.push_back(p[k] + Random(rng, -0.01, 0.01));
    }
  }
  for (const Face& face : sphere.faces) {
    scene->mesh.faces.insert(scene->mesh.faces.end(), face.begin(), face.end());
  }
  scene->mesh.channels = 0;
  scene->mesh.camera = SideCamera(shape);
}

// Coordinates from x and y, so that a texel is several pixels.
void AddTexture(Filter filter, Rng* rng, OwnedScene<float>* scene) {
  for (std::size_t v = 0; v < scene->mesh.vertex_count(); ++v) {
    for (const std::size_t k : {0u, 1u}) {
      scene->uvs.push_back(0.5f + 0.4f * scene->mesh.positions[3 * v + k]);
    }
  }
  scene->uvs_rate = Rate::kVertex;
  scene->textures.push_back({RandomNumbers(8 * 7 * 3, 0.2, 0.9, rng), 8, 7, Wrap::kRepeat, filter});
}

void AddSurfaces(Rng* rng, OwnedScene<float>* scene) {
  for (int k = 0; k < 2; ++k) {
    scene->surfaces.push_back({RandomTriple(0.5, 1, rng), k - 1, RandomTriple(0.1, 0.3, rng),
                               RandomTriple(0.5, 1, rng), RandomTriple(0.2, 0.5, rng),
                               Random(rng, 4, 10)});
  }
  for (std::size_t f = 0; f < scene->mesh.face_count(); ++f) {
    scene->face_surfaces.push_back(static_cast<std::int32_t>(rng->Below(2)));
  }
}

void AddLight(const SphereShape& shape, Rng* rng, OwnedScene<float>* scene) {
  scene->shading.lighting = shape.lighting;
  scene->shading.normals = shape.normals;
  scene->shading.two_sided = true;
  if (shape.lighting == Lighting::kSphericalHarmonics) scene->sh = RandomNumbers(9, 0.1, 0.5, rng);
  if (!UsesLights(scene->shading)) return;
  scene->lights = {{{0.3f, 0.5f, 1.0f}, 0.8f}, {{-1.0f, 0.7f, 0.9f}, 0.4f}};
}

}  // namespace

OwnedScene<float> MakeSphere(const SphereShape& shape) {
  Rng rng(shape.seed, 20);
  OwnedScene<float> scene;
  AddMesh(shape, &rng, &scene);
  scene.colors = RandomNumbers(scene.mesh.positions.size(), 0.2, 0.9, &rng);
  AddTexture(shape.filter, &rng, &scene);
  AddSurfaces(&rng, &scene);
  AddLight(shape, &rng, &scene);
  return scene;
}

Outputs ImagesWithGradients() {
  Outputs request;
  request.depth = request.normals = request.uv = true;
  return request;
}

RenderOptions SphereOptions(const SphereShape& shape) {
  RenderOptions options;
  options.width = shape.width;
  options.height = shape.height;
  options.delta = 1e-2;
  options.max_alpha_error = 1e-7;
  return options;
}

}  // namespace tilegrad::selftest
