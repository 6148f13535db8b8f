// SPDX-License-Identifier: Apache-2.0
// The scenes of fingerprint_cases.h, and arrays for what is pulled and wanted. Nearly all numbers
// are whole 1024ths, so that float and double hold the same; no function of libm makes any.
#pragma once

#include <tilegrad/tilegrad.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "api/fingerprint_cases.h"
#include "api/fingerprint_meshes.h"

namespace tilegrad::test {

template <class T>
T Part(int n) {
  return static_cast<T>(n) / T(1024);
}

template <class T>
std::vector<T> Parts(std::size_t count, int low, int high, std::uint64_t stream) {
  Integers integers(stream);
  std::vector<T> out(count);
  for (T& x : out) x = Part<T>(integers.Next(low, high));
  return out;
}

template <class T>
std::array<T, 3> ThreeParts(int low, int high, Integers* integers) {
  std::array<T, 3> out;
  for (T& x : out) x = Part<T>(integers->Next(low, high));
  return out;
}

// The matrix of a quaternion of whole numbers: one division an entry.
template <class T>
void SetRotation(const std::array<int, 4>& q, CameraT<T>* camera) {
  const auto [a, b, c, d] = q;
  const int rows[9] = {
      a * a + b * b - c * c - d * d, 2 * (b * c - a * d),           2 * (b * d + a * c),
      2 * (b * c + a * d),           a * a - b * b + c * c - d * d, 2 * (c * d - a * b),
      2 * (b * d - a * c),           2 * (c * d + a * b),           a * a - b * b - c * c + d * d};
  const int square = a * a + b * b + c * c + d * d;
  for (std::size_t i = 0; i < 9; ++i) {
    camera->rotation[i] = static_cast<T>(rows[i]) / static_cast<T>(square);
  }
}

// Of image n of a batch.
template <class T>
CameraT<T> MakeTestCamera(const Case& c, int n) {
  CameraT<T> camera;
  const bool inside = c.shape == Shape::kAround;
  const int turns = inside ? 1 + n % 3 : 3 + 4 * (n % 3);
  SetRotation<T>({16, 2 - n % 5, turns, 1}, &camera);
  const int side = std::min(c.options.width, c.options.height);
  camera.translation[0] = Part<T>(30 + 50 * n);
  camera.translation[1] = Part<T>(-40);
  camera.translation[2] = inside ? T(0) : Part<T>(-2900 - 100 * n);
  camera.fx = Part<T>(side * 1200);
  camera.fy = Part<T>(side * 1250);
  camera.cx = Part<T>(c.options.width * 520);
  camera.cy = Part<T>(c.options.height * 505);
  camera.near_plane = Part<T>(inside ? 200 : 16);
  return camera;
}

// A scene with its arrays. Of a batch's other meshes, each is a bit larger than the one before.
template <class T>
class OwnScene {
 public:
  OwnScene(const Case& c, int n) : stream_(100 * static_cast<std::uint64_t>(n + 1)) {
    SetMesh(c, c.size + n);
    SetStreams(c);
    SetTextures(c);
    SetSurfaces(c);
    SetLights(c);
    view_.camera = MakeTestCamera<T>(c, n);
    view_.shading = c.shading;
  }
  OwnScene(const OwnScene&) = delete;
  OwnScene& operator=(const OwnScene&) = delete;

  const SceneT<T>& view() const { return view_; }

 private:
  void SetMesh(const Case& c, int size) {
    mesh_ = MakeMesh(c.shape, size, stream_);
    for (const Point& p : mesh_.points) {
      for (const int x : p) positions_.push_back(Part<T>(x));
    }
    view_.positions = positions_;
    view_.faces = mesh_.faces;
  }

  // The vertices whose values a stream has one after the other.
  std::vector<std::size_t> Rows(Rate rate) const {
    if (rate == Rate::kCorner) return {mesh_.faces.begin(), mesh_.faces.end()};
    std::vector<std::size_t> out(mesh_.points.size());
    for (std::size_t v = 0; v < out.size(); ++v) out[v] = v;
    return out;
  }

  void SetStreams(const Case& c) {
    if (c.colors) {
      colors_ = Parts<T>(3 * Rows(*c.colors).size(), -100, 1250, stream_ + 1);
      view_.colors = {colors_, *c.colors};
    }
    if (c.attributes) {
      const auto channels = static_cast<std::size_t>(c.channels);
      attributes_ = Parts<T>(channels * Rows(*c.attributes).size(), -1024, 1024, stream_ + 2);
      view_.attributes = {attributes_, *c.attributes};
      view_.channels = c.channels;
    }
    if (c.uvs) SetUvs(*c.uvs);
    if (c.normals) SetNormals(*c.normals);
  }
  // About two tiles of the texture across a ball.
  void SetUvs(Rate rate) {
    Integers integers(stream_ + 3);
    for (const std::size_t v : Rows(rate)) {
      const Point& p = mesh_.points[v];
      uvs_.push_back(Part<T>(p[0] + 350 + integers.Next(-60, 60)));
      uvs_.push_back(Part<T>(p[1] - p[2] / 2 + 250 + integers.Next(-60, 60)));
    }
    view_.uvs = {uvs_, rate};
  }
  void SetNormals(Rate rate) {
    Integers integers(stream_ + 4);
    for (const std::size_t v : Rows(rate)) {
      for (const int x : PointNear(mesh_.points[v], 300, &integers)) normals_.push_back(Part<T>(x));
    }
    view_.normals = {normals_, rate};
  }

  void SetTextures(const Case& c) {
    for (const Picture& p : c.textures) {
      const auto numbers = 3 * static_cast<std::size_t>(p.width * p.height);
      texels_.push_back(Parts<T>(numbers, 0, 1024, stream_ + 10 + texels_.size()));
      textures_.push_back({texels_.back(), p.width, p.height, p.wrap, p.filter});
    }
    view_.textures = textures_;
  }

  // Textures in turn, then none.
  void SetSurfaces(const Case& c) {
    Integers integers(stream_ + 5);
    const int textures = static_cast<int>(c.textures.size());
    for (int s = 0; s < c.surfaces; ++s) {
      SurfaceT<T> out{.base_color = ThreeParts<T>(300, 1024, &integers)};
      out.texture = s % (textures + 1) < textures ? s % (textures + 1) : -1;
      out.ambient = ThreeParts<T>(0, 300, &integers);
      out.diffuse = ThreeParts<T>(300, 1024, &integers);
      out.specular = ThreeParts<T>(100, 600, &integers);
      out.shininess = static_cast<T>(integers.Next(1, 40));
      surfaces_.push_back(out);
    }
    view_.surfaces = surfaces_;
    if (c.surfaces < 2) return;
    for (std::size_t f = 0; f < mesh_.faces.size() / 3; ++f) {
      face_surfaces_.push_back(static_cast<std::int32_t>(f) % c.surfaces);
    }
    view_.face_surfaces = face_surfaces_;
  }

  // From where the camera is, roughly.
  void SetLights(const Case& c) {
    Integers integers(stream_ + 6);
    for (int l = 0; l < c.lights; ++l) {
      LightT<T> light{ThreeParts<T>(-900, 900, &integers)};
      light.direction[2] += T(1);
      light.intensity = Part<T>(integers.Next(300, 1200));
      lights_.push_back(light);
    }
    view_.lights = lights_;
    if (c.light_directions) {
      light_directions_ = Parts<T>(positions_.size(), -500, 1000, stream_ + 7);
      view_.light_directions = light_directions_;
    }
    if (c.shading.lighting == Lighting::kSphericalHarmonics) {
      view_.sh = sh_ = Parts<T>(9, -300, 900, stream_ + 8);
    }
  }

  std::uint64_t stream_;
  IntegerMesh mesh_;
  std::vector<T> positions_, colors_, uvs_, normals_, attributes_, light_directions_, sh_;
  std::vector<std::vector<T>> texels_;
  std::vector<TextureT<T>> textures_;
  std::vector<SurfaceT<T>> surfaces_;
  std::vector<std::int32_t> face_surfaces_;
  std::vector<LightT<T>> lights_;
  SceneT<T> view_;
};

// All scenes of a case.
template <class T>
struct TestBatch {
  std::vector<std::unique_ptr<OwnScene<T>>> owners;
  std::vector<SceneT<T>> scenes;

  explicit TestBatch(const Case& c) {
    for (int n = 0; n < c.scenes; ++n) {
      if (n == 0 || !c.one_mesh) owners.push_back(std::make_unique<OwnScene<T>>(c, n));
      scenes.push_back(owners.back()->view());
      scenes.back().camera = MakeTestCamera<T>(c, n);
    }
  }
};

// dL/d(images) of those that were rendered and that the case pulls on.
template <class T>
struct PulledImages {
  std::map<std::string, std::vector<T>> arrays;
  FrameGradientsT<T> view;

  PulledImages(const Case& c, const ImagesT<T>& images) {
    const auto add = [&](const char* name, std::span<const T> image) -> std::span<const T> {
      if (!c.pulled.empty() && c.pulled.count(name) == 0) return {};
      return arrays[name] = Parts<T>(image.size(), -1024, 1024, 50 + arrays.size());
    };
    view.color = add("color", images.color);
    view.alpha = add("alpha", images.alpha);
    view.attributes = add("attributes", images.attributes);
    view.normals = add("normals", images.normals);
    view.uv = add("uv", images.uv);
    if (c.options.interpolation == Interpolation::kPerspective) {
      view.depth = add("depth", images.depth);
    }
  }
};

// Arrays for the gradients of a scene. They hold numbers before: those are overwritten or added to.
template <class T>
class WantedGradients {
 public:
  WantedGradients(const Case& c, const SceneT<T>& scene) : case_(c) {
    view_.positions = Array("positions", scene.positions.size());
    view_.colors = Array("colors", scene.colors.values.size());
    view_.uvs = Array("uvs", scene.uvs.values.size());
    view_.normals = Array("normals", scene.normals.values.size());
    view_.light_directions = Array("light_directions", scene.light_directions.size());
    view_.sh = Array("sh", scene.sh.size());
    view_.attributes = Array("attributes", scene.attributes.values.size());
    SetTextures(scene);
    SetRecords(scene);
  }
  WantedGradients(const WantedGradients&) = delete;
  WantedGradients& operator=(const WantedGradients&) = delete;

  const SceneGradientsT<T>& view() const { return view_; }

  // Calls visit(name, numbers) for all that is wanted.
  template <class Visit>
  void ForEach(const Visit& visit) const {
    for (const auto& [name, array] : arrays_) visit(name, std::span<const T>(array));
    for (const auto& texels : textures_) visit("textures", std::span<const T>(texels));
    if (view_.camera != nullptr) VisitCamera(visit);
    for (const auto& s : surfaces_) {
      for (const auto* color : {&s.base_color, &s.ambient, &s.diffuse, &s.specular}) {
        visit("surfaces", std::span<const T>(*color));
      }
      visit("surfaces", std::span<const T>(&s.shininess, 1));
    }
    for (const auto& light : lights_) {
      visit("lights", std::span<const T>(light.direction));
      visit("lights", std::span<const T>(&light.intensity, 1));
    }
  }

 private:
  bool Wants(const std::string& name) const {
    return case_.wanted.empty() || case_.wanted.count(name) > 0;
  }
  std::span<T> Array(const std::string& name, std::size_t size) {
    if (size == 0 || !Wants(name)) return {};
    return arrays_[name] = Parts<T>(size, -1024, 1024, 70 + arrays_.size());
  }
  void SetTextures(const SceneT<T>& scene) {
    if (!Wants("textures")) return;
    for (const auto& texture : scene.textures) {
      textures_.push_back(Parts<T>(texture.texels.size(), -1024, 1024, 80));
    }
    texture_views_.assign(textures_.begin(), textures_.end());
    view_.textures = texture_views_;
  }
  void SetRecords(const SceneT<T>& scene) {
    if (Wants("camera")) view_.camera = &camera_;
    if (Wants("surfaces")) surfaces_.resize(scene.surfaces.size());
    // The default surface, where it is asked for by name.
    if (case_.wanted.count("surfaces") > 0 && surfaces_.empty()) surfaces_.resize(1);
    if (Wants("lights")) lights_.resize(scene.lights.size());
    view_.surfaces = surfaces_;
    view_.lights = lights_;
  }
  template <class Visit>
  void VisitCamera(const Visit& visit) const {
    const T lens[] = {camera_.fx, camera_.fy, camera_.cx, camera_.cy, camera_.near_plane};
    visit("camera", std::span<const T>(camera_.rotation));
    visit("camera", std::span<const T>(camera_.translation));
    visit("camera", std::span<const T>(lens));
  }

  const Case& case_;
  std::map<std::string, std::vector<T>> arrays_;
  std::vector<std::vector<T>> textures_;
  std::vector<std::span<T>> texture_views_;
  CameraT<T> camera_;  // these three hold defaults, which are no zeros
  std::vector<SurfaceT<T>> surfaces_;
  std::vector<LightT<T>> lights_;
  SceneGradientsT<T> view_;
};

}  // namespace tilegrad::test
