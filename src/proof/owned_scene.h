// SPDX-License-Identifier: Apache-2.0
// Scenes that own their arrays, in any scalar type, with gradients, cotangents and access to all
// numbers by name: for proofs that compare the Renderer with the reference, and the reference with
// differences (tests/render, src/proof/selftest).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "base/rng.h"
#include "render/reference.h"
#include "render/renderer.h"
#include "render/scene_fields.h"
#include "scene/camera.h"
#include "tilegrad/renderer.h"

namespace tilegrad {

template <class T>
struct OwnedMesh {
  std::vector<T> positions;
  std::vector<std::int32_t> faces;
  std::vector<T> attributes;
  int channels = 3;
  Rate rate = Rate::kVertex;
  CameraT<T> camera;

  SceneT<T> View() const {
    return {.positions = positions,
            .faces = faces,
            .camera = camera,
            .attributes = {attributes, rate},
            .channels = channels};
  }
  std::size_t vertex_count() const { return positions.size() / 3; }
  std::size_t face_count() const { return faces.size() / 3; }
};

template <class T, class U>
OwnedMesh<T> MeshCast(const OwnedMesh<U>& s) {
  return {{s.positions.begin(), s.positions.end()},
          s.faces,
          {s.attributes.begin(), s.attributes.end()},
          s.channels,
          s.rate,
          CameraCast<T>(s.camera)};
}

template <class T>
struct OwnedTexture {
  std::vector<T> texels;
  int width = 1, height = 1;
  Wrap wrap = Wrap::kRepeat;
  Filter filter = Filter::kBilinear;
};

// Owns what a Scene views.
template <class T>
struct OwnedScene {
  ShadingModel shading;
  OwnedMesh<T> mesh;  // its attributes are the user's channels
  std::vector<T> colors, uvs, normals, light_directions, sh;
  Rate colors_rate = Rate::kVertex, uvs_rate = Rate::kCorner;
  Rate normals_rate = Rate::kVertex;
  std::vector<OwnedTexture<T>> textures;
  std::vector<SurfaceT<T>> surfaces;
  std::vector<std::int32_t> face_surfaces;
  std::vector<LightT<T>> lights;
  std::vector<TextureT<T>> texture_views;  // made by View

  SceneT<T> View() {
    texture_views.clear();
    for (const auto& t : textures) {
      texture_views.push_back({t.texels, t.width, t.height, t.wrap, t.filter});
    }
    SceneT<T> out = mesh.View();
    out.colors = {colors, colors_rate};
    out.uvs = {uvs, uvs_rate};
    out.normals = {normals, normals_rate};
    out.textures = texture_views;
    out.surfaces = surfaces;
    out.face_surfaces = face_surfaces;
    out.shading = shading;
    out.lights = lights;
    out.light_directions = light_directions;
    out.sh = sh;
    return out;
  }
};

// Calls visit(name, number) for every number of a scene that has a gradient. `scene` may be an
// OwnedScene or anything with the same members, so gradients are visited in the same order.
template <class T, class Visit>
void ForEachNumber(OwnedScene<T>& s, const Visit& visit) {
  const auto all = [&](const char* name, auto&& values) {
    for (auto& v : values) visit(name, v);
  };
  all("positions", s.mesh.positions);
  all("attributes", s.mesh.attributes);
  all("colors", s.colors);
  all("uvs", s.uvs);
  all("normals", s.normals);
  all("light_directions", s.light_directions);
  all("sh", s.sh);
  for (auto& t : s.textures) all("texture", t.texels);
  for (auto& u : s.surfaces) ForEachSurfacePart(all, u);
  for (auto& l : s.lights) {
    all("light", l.direction);
    visit("intensity", l.intensity);
  }
  CameraT<T>& camera = s.mesh.camera;
  all("rotation", camera.rotation);
  all("translation", camera.translation);
  for (T* number : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) visit("lens", *number);
}

template <class T, class U>
OwnedScene<T> OwnedCast(const OwnedScene<U>& s) {
  const auto cast = [](const auto& v) { return std::vector<T>(v.begin(), v.end()); };
  const auto cast3 = [](const std::array<U, 3>& v) {
    return std::array<T, 3>{T(v[0]), T(v[1]), T(v[2])};
  };
  OwnedScene<T> out;
  out.shading = s.shading;
  out.mesh = MeshCast<T>(s.mesh);
  out.colors = cast(s.colors);
  out.uvs = cast(s.uvs);
  out.normals = cast(s.normals);
  out.light_directions = cast(s.light_directions);
  out.sh = cast(s.sh);
  out.colors_rate = s.colors_rate;
  out.uvs_rate = s.uvs_rate;
  out.normals_rate = s.normals_rate;
  for (const auto& t : s.textures) {
    out.textures.push_back({cast(t.texels), t.width, t.height, t.wrap, t.filter});
  }
  for (const auto& u : s.surfaces) {
    out.surfaces.push_back({cast3(u.base_color), u.texture, cast3(u.ambient), cast3(u.diffuse),
                            cast3(u.specular), T(u.shininess)});
  }
  for (const auto& l : s.lights) out.lights.push_back({cast3(l.direction), T(l.intensity)});
  out.face_surfaces = s.face_surfaces;
  return out;
}

// Gradients of a scene: the same members, all 0, and the views that a renderer writes to.
template <class T>
struct OwnedGradients {
  OwnedScene<T> d;
  std::vector<std::span<T>> textures;

  explicit OwnedGradients(const OwnedScene<T>& scene) : d(scene) {
    ForEachNumber(d, [](const char*, T& v) { v = T(0); });
    for (auto& t : d.textures) textures.push_back(t.texels);
  }
  SceneGradientsT<T> View() {
    SceneGradientsT<T> view;
    view.positions = d.mesh.positions;
    view.attributes = d.mesh.attributes;
    view.camera = &d.mesh.camera;
    view.colors = d.colors;
    view.uvs = d.uvs;
    view.light_directions = d.light_directions;
    if (d.shading.normals == Normals::kGiven) view.normals = d.normals;
    view.textures = textures;
    view.surfaces = d.surfaces;
    view.lights = d.lights;
    view.sh = d.sh;
    return view;
  }
};

// Cotangents of all images, random in [-1, 1].
template <class T>
struct OwnedCotangents {
  std::vector<T> color, alpha, normals, uv, depth, attributes;

  OwnedCotangents() = default;
  OwnedCotangents(std::size_t pixels, std::size_t channels, Rng* rng) {
    for (const auto& [v, planes] : {std::pair{&color, std::size_t{3}},
                                    {&alpha, 1},
                                    {&normals, 3},
                                    {&uv, 2},
                                    {&depth, 1},
                                    {&attributes, channels}}) {
      v->resize(planes * pixels);
      for (T& d : *v) d = static_cast<T>(static_cast<float>(rng->Uniform(-1, 1)));
    }
  }
  template <class U>
  OwnedCotangents<U> Cast() const {
    OwnedCotangents<U> out;
    ForEachImage(
        0,
        [](const char*, int, const std::vector<T>& from, std::vector<U>& to) {
          to.assign(from.begin(), from.end());
        },
        *this, out);
    return out;
  }
  FrameGradientsT<T> View() const { return {color, alpha, attributes, normals, uv, depth}; }
};

// The images of an owned scene and the gradients of sum(images * cotangents), by the Renderer and
// by the reference.

template <class T>
struct OwnedRendering {
  FrameImagesT<T> frame;
  OwnedScene<T> d;  // gradients
};

// Copies images.
template <class T>
FrameImagesT<T> OwnedImages(const ImagesT<T>& images) {
  FrameImagesT<T> out;
  out.images = images.count;
  out.height = images.height;
  out.width = images.width;
  out.channels = images.channels;
  out.face_ids.assign(images.face_ids.begin(), images.face_ids.end());
  ForEachOutput(
      images.channels,
      [](const char*, int, AlignedVector<T>& to, std::span<const T> from) {
        to.assign(from.begin(), from.end());
      },
      out, images);
  out.alpha_error_bound = images.alpha_error_bound;
  return out;
}

inline Status RenderOwned(OwnedScene<float>& scene, const RenderOptions& options,
                          const Outputs& request, const OwnedCotangents<float>& d_frame,
                          const Workers& workers, OwnedRendering<float>* out) {
  Renderer renderer = RendererOn(workers);
  Frame frame;
  const Scene view = scene.View();
  TILEGRAD_TRY(renderer.Render({&view, 1}, options, request, &frame));
  out->frame = OwnedImages(frame.images());
  OwnedGradients<float> gradients(scene);
  const SceneGradients d_scene = gradients.View();
  TILEGRAD_TRY(renderer.Backward(frame, d_frame.View(), {&d_scene, 1}));
  out->d = gradients.d;
  return {};
}

// With visibility given as face ids of the scene [H,W].
template <class T>
OwnedScene<T> OwnedRefBackward(OwnedScene<T>& scene, const RenderOptions& options,
                               const OwnedCotangents<T>& d_frame,
                               std::span<const std::int32_t> face_ids) {
  OwnedGradients<T> gradients(scene);
  ReferenceRenderBackward<T>(scene.View(), options, face_ids, d_frame.View(), gradients.View());
  return gradients.d;
}

template <class T>
OwnedRendering<T> RenderOwnedRef(OwnedScene<T>& scene, const RenderOptions& options,
                                 const Outputs& request, const OwnedCotangents<T>& d_frame,
                                 std::span<const std::int32_t> face_ids) {
  OwnedRendering<T> out;
  ReferenceRender<T>(scene.View(), options, request, face_ids, &out.frame);
  out.d = OwnedRefBackward<T>(scene, options, d_frame, face_ids);
  return out;
}

}  // namespace tilegrad
