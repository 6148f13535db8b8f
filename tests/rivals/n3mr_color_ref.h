// SPDX-License-Identifier: Apache-2.0
// The truth of n3mr_color.h. Drawing: T float, double, std::complex<double>; backward, with the
// sweep: float or double.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "rivals/n3mr_color.h"
#include "rivals/n3mr_ref.h"

namespace tilegrad::rivals {

template <class T>
struct N3mrSceneRef {
  std::span<const T> corners;   // [F,3,3]
  std::span<const T> textures;  // [F,s,s,s,3]
  int size;
  N3mrOptions options;
  N3mrColors colors;

  std::size_t CubeOf(const N3mrFaceT<T>& face) const {
    return 3 * colors.texels() * static_cast<std::size_t>(face.source);
  }
};

// Planes r, g, b of a drawing, background filled in.
template <class T>
std::vector<T> ColorPlanesRef(const N3mrSceneRef<T>& scene, const N3mrDrawingRef<T>& drawing) {
  const std::size_t pixels = drawing.owner.size();
  std::vector<T> out(3 * pixels);
  for (std::size_t p = 0; p < pixels; ++p) {
    T color[3] = {T(scene.colors.background[0]), T(scene.colors.background[1]),
                  T(scene.colors.background[2])};
    if (drawing.owner[p] >= 0) {
      const N3mrFaceT<T>& face = drawing.faces[static_cast<std::size_t>(drawing.owner[p])];
      MixTexels(N3mrTexelsAt(face, drawing.weights[p].data(), drawing.depth[p],
                             scene.colors.resolution, scene.options.eps),
                &scene.textures[scene.CubeOf(face)], color);
    }
    for (std::size_t c = 0; c < 3; ++c) out[c * pixels + p] = color[c];
  }
  return out;
}

template <class T>
void N3mrSceneForwardRef(const N3mrSceneRef<T>& scene, const N3mrImages<T>& out) {
  const N3mrDrawingRef<T> drawing(scene.corners, scene.size, scene.options);
  const std::size_t pixels = drawing.owner.size(), plane = out.color.size() / 3;
  if (!out.alpha.empty()) ReduceN3mr<T>(scene.options, scene.size, CoverageOf(drawing), out.alpha);
  if (out.color.empty()) return;
  const std::vector<T> planes = ColorPlanesRef(scene, drawing);
  for (std::size_t c = 0; c < 3; ++c) {
    ReduceN3mr<T>(scene.options, scene.size, std::span(planes).subspan(c * pixels, pixels),
                  out.color.subspan(c * plane, plane));
  }
}

// The planes that are asked for, side by side, and their adjoints in the drawing.
template <class T>
struct N3mrPushesRef {
  std::vector<T> values, d_values;

  void Add(const N3mrSceneRef<T>& scene, std::span<const T> plane, std::span<const T> d_image) {
    values.insert(values.end(), plane.begin(), plane.end());
    d_values.resize(values.size());
    ReduceN3mrAdjoint<T>(scene.options, scene.size, d_image,
                         std::span(d_values).last(plane.size()));
  }
};

// The exact part: texels.
template <class T>
void AddTexelAdjointsRef(const N3mrSceneRef<T>& scene, const N3mrDrawingRef<T>& drawing,
                         std::span<const T> d_color, std::span<T> d_textures) {
  const std::size_t pixels = drawing.owner.size();
  for (std::size_t p = 0; p < pixels; ++p) {
    if (drawing.owner[p] < 0) continue;
    const N3mrFaceT<T>& face = drawing.faces[static_cast<std::size_t>(drawing.owner[p])];
    const T* const w = drawing.weights[p].data();
    const T g[3] = {d_color[p], d_color[pixels + p], d_color[2 * pixels + p]};
    MixTexelsAdjoint(
        N3mrTexelsAt(face, w, drawing.depth[p], scene.colors.resolution, scene.options.eps), g,
        &d_textures[scene.CubeOf(face)]);
  }
}

// Adds to d_corners and d_textures.
template <class T>
void N3mrSceneBackwardRef(const N3mrSceneRef<T>& scene, const N3mrImages<const T>& d_images,
                          const N3mrColorAdjoints<T>& out) {
  const N3mrDrawingRef<T> drawing(scene.corners, scene.size, scene.options);
  const std::size_t pixels = drawing.owner.size(), plane = d_images.color.size() / 3;
  N3mrPushesRef<T> pushes;
  if (!d_images.color.empty()) {
    const std::vector<T> planes = ColorPlanesRef(scene, drawing);
    for (std::size_t c = 0; c < 3; ++c) {
      pushes.Add(scene, std::span(planes).subspan(c * pixels, pixels),
                 d_images.color.subspan(c * plane, plane));
    }
  }
  if (!pushes.values.empty())
    AddTexelAdjointsRef<T>(scene, drawing, pushes.d_values, out.d_textures);
  if (!d_images.alpha.empty()) pushes.Add(scene, CoverageOf(drawing), d_images.alpha);
  const int channels = static_cast<int>(pushes.values.size() / pixels);
  const SweepImages<T> images{drawing.inner, channels, pushes.values, pushes.d_values,
                              drawing.owner};
  for (std::size_t f = 0; f < drawing.faces.size() && channels > 0; ++f) {
    const N3mrFaceT<T>& face = drawing.faces[f];
    SweepFaceRef(face, static_cast<std::int32_t>(f), images, scene.options,
                 scene.options.Scale(scene.size),
                 &out.d_corners[kCornerNumbers * static_cast<std::size_t>(face.source)]);
  }
}

}  // namespace tilegrad::rivals
